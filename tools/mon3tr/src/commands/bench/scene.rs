//! One camera's view of one scene, drawn again and again with a fresh sort each time: what a comparison with another
//! renderer measures.

use super::measure::{Medians, Samples, print_table};
use super::render::Options;
use crate::film::write_png;
use crate::report::{check_writable, write_json};
use crate::scenery;
use crate::stage::{Size, Views};
use crate::surroundings::describe;
use crate::viewpoint::eyes;
use anyhow::Context;
use image::RgbImage;
use serde::Serialize;
use splat_scene::cameras::Cameras;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use xr_renderer::{Backdrop, Background, Gpu, RendererOptions, SplatRenderer};

/// Without `--size`.
const DEFAULT_SIZE: Size = Size {
    width: 1024,
    height: 1024,
};

/// Frames before the counted ones; on the first one the back ends are compared.
const WARM_UP: usize = 2;

/// What the run measured.
#[derive(Debug, Serialize)]
struct Measured {
    scene: PathBuf,
    gaussians: u32,
    camera: i64,
    width: u32,
    height: u32,
    views: usize,
    back_end: String,
    device: String,
    #[serde(flatten)]
    samples: Samples,
    medians: Medians,
}

pub(crate) fn run(
    options: &Options,
    file: &Path,
    cameras: &Path,
    gpu: &Arc<Gpu>,
) -> anyhow::Result<()> {
    for path in [&options.json, &options.png].into_iter().flatten() {
        check_writable(path)?;
    }
    let Size { width, height } = options.size.unwrap_or(DEFAULT_SIZE);
    let camera = Cameras::load(cameras)?;
    let camera = scenery::camera(camera.get(options.id)?, width, height);
    let views = if options.stereo {
        Views::Stereo
    } else {
        Views::Mono
    };
    // The scene's unit is taken for a metre.
    let cameras = eyes(camera, views);
    let background = Background::pack(&scenery::load(file)?);
    let gaussians = background.len();
    let renderer_options = RendererOptions {
        background: Some(Arc::new(background)),
        back_end: options.back_end.map(Into::into),
        ..RendererOptions::new(0, width, height, views.count())
    };
    let mut renderer = SplatRenderer::new(Arc::clone(gpu), &renderer_options)
        .context("cannot prepare the renderer")?;
    for _ in 0..WARM_UP {
        renderer.draw(&cameras)?;
    }
    let mut samples = Samples::default();
    for _ in 0..options.frames {
        renderer.forget_order();
        let start = Instant::now();
        renderer.draw(&cameras)?;
        samples.push(start.elapsed(), &renderer.stage_times());
    }
    if let Some(path) = &options.png {
        let rgb = renderer.read_back(0)?.over(Backdrop::Colour([0.0; 3]));
        let picture = RgbImage::from_raw(width, height, rgb)
            .context("the renderer returned a picture of another size")?;
        write_png(path, &picture)?;
    }
    let measured = Measured {
        scene: file.to_path_buf(),
        gaussians,
        camera: options.id,
        width,
        height,
        views: cameras.len(),
        back_end: renderer.back_end().to_string(),
        device: describe(gpu),
        medians: samples.medians(),
        samples,
    };
    measured.print(options.frames);
    options
        .json
        .as_ref()
        .map_or(Ok(()), |file| write_json(file, &measured))
}

impl Measured {
    fn print(&self, frames: u32) {
        let views = if self.views == 2 { "2 x " } else { "" };
        println!(
            "{}: {} Gaussians, camera {}, {views}{}x{}, by {} on {}, median of {frames} frames\n",
            self.scene.display(),
            self.gaussians,
            self.camera,
            self.width,
            self.height,
            self.back_end,
            self.device
        );
        print_table(&Medians::HEADINGS, &[self.medians.row()]);
    }
}
