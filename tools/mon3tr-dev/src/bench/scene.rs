//! One camera's view of one scene, drawn again and again with a fresh sort each time: what a comparison with another
//! renderer measures.

use super::measure::{Medians, Samples, print_table};
use super::render_options::Options;
use anyhow::Context;
use glam::Vec3;
use image::RgbImage;
use mon3tr::device_options::describe;
use mon3tr::film::write_png;
use mon3tr::report::{check_writable, write_json};
use mon3tr::scenery::{Scenery, load_camera};
use mon3tr::size::{DEFAULT_SIZE, Size, Views};
use mon3tr::viewpoint::eyes;
use renderer_splat::options::RendererOptions;
use renderer_splat::picture::Backdrop;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Vertical field of view without a cameras.json.
const OVERVIEW_DEGREES: f32 = 40.0;

/// Frames before the counted ones; on the first one the back ends are compared.
const WARM_UP: usize = 2;

/// What the run measured.
#[derive(Debug, Serialize)]
struct Measured {
    scene: PathBuf,
    gaussians: usize,
    /// Absent where the whole scene is seen.
    camera: Option<i64>,
    width: u32,
    height: u32,
    views: usize,
    back_end: String,
    device: String,
    #[serde(flatten)]
    samples: Samples,
    medians: Medians,
}

pub(crate) fn run(options: &Options, file: &Path, gpu: &Arc<Gpu>) -> anyhow::Result<()> {
    for path in [&options.json, &options.png].into_iter().flatten() {
        check_writable(path)?;
    }
    let size = options.size.unwrap_or(DEFAULT_SIZE);
    let Size { width, height } = size;
    let scenery = Scenery::drawable(file, options.up, options.view.as_deref())?;
    let scene_camera = (options.view.as_ref())
        .map(|cameras| load_camera(cameras, options.id))
        .transpose()?;
    let camera = match &scene_camera {
        Some(camera) => scenery.camera(camera, size),
        None => scenery.overview(Vec3::NEG_Z, OVERVIEW_DEGREES, size),
    };
    let views = if options.stereo {
        Views::Stereo
    } else {
        Views::Mono
    };
    // The scene's unit is taken for a metre.
    let cameras = eyes(camera, views);
    let renderer_options = RendererOptions {
        background: Some(Arc::clone(&scenery.background)),
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
        gaussians: scenery.figures.gaussians,
        camera: scene_camera.map(|camera| camera.id),
        width,
        height,
        views: cameras.len(),
        back_end: renderer.back_end().to_string(),
        device: describe(gpu),
        medians: samples.medians(),
        samples,
    };
    measured.print(options.frames);
    write_json(options.json.as_deref(), &measured)
}

impl Measured {
    fn print(&self, frames: u32) {
        let views = if self.views == 2 { "2 x " } else { "" };
        println!(
            "{}: {} Gaussians, {}, {views}{}x{}, by {} on {}, median of {frames} frames\n",
            self.scene.display(),
            self.gaussians,
            (self.camera).map_or_else(|| "seen whole".to_owned(), |id| format!("camera {id}")),
            self.width,
            self.height,
            self.back_end,
            self.device
        );
        print_table(&Medians::HEADINGS, &[self.medians.row()]);
    }
}
