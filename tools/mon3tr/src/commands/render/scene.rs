//! A scene with no one in it: one picture from one camera.

use super::{Options, write_frame};
use crate::backdrop::DUSK;
use crate::device_options::{DeviceOptions, describe};
use crate::report::{Splatting, StageTable, write_json};
use crate::scenery::{SceneFigures, Scenery};
use crate::stills::{RenderSettings, to_rgb};
use crate::viewpoint::{CameraChoice, eyes};
use anyhow::{Context, bail};
use app_pipeline::profile::Profile;
use app_pipeline::stage::Unit;
use glam::{Quat, Vec3};
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::picture::Image;
use renderer_splat::renderer::SplatRenderer;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the run leaves.
#[derive(Debug, Serialize)]
struct Report {
    background: SceneFigures,
    /// Where the eye (without stereo) is, in the scene's units.
    eye: [f32; 3],
    vulkan_device: String,
    vulkan_driver: String,
    runs: Vec<StageTable>,
    pictures: Vec<PathBuf>,
}

pub(super) fn run(options: &Options, file: &Path, device: &DeviceOptions) -> anyhow::Result<()> {
    if options.motion.is_given() || options.scenery.place.is_some() {
        bail!(
            "--motion, --bvh-scale, --frames and --place are about a person: give an avatar PACKAGE too"
        );
    }
    let scenery = Scenery::drawable(file, options.scenery.up, options.camera_file())?;
    let scene_camera = options.scene_camera()?;
    let size = options.size(scene_camera.as_ref())?;
    let camera = match (&options.view, &scene_camera) {
        (_, Some(camera)) => scenery.camera(camera, size),
        (CameraChoice::Exact(view), _) => {
            view.camera(Vec3::ZERO, Quat::IDENTITY, size.width, size.height)
        }
        (CameraChoice::Named(view), _) => {
            scenery.overview(view.direction(), view.fov_degrees(), size)
        }
        (CameraChoice::File(_), None) => bail!("the scene's camera is missing"),
    };
    let gpu = device.gpu()?;
    options.prepare_output()?;

    let views = options.views();
    let setting = RenderSettings {
        size,
        views,
        background: Some(Arc::clone(&scenery.background)),
        filter: options.filter.map_or(scenery.filter(), Into::into),
    };
    let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &setting.renderer(0)?)
        .context("cannot prepare the renderer")?;
    let cameras = eyes(camera, views);
    let splatted = match splat(&mut renderer, &cameras) {
        Err(error) if error.is_device_lost() => {
            log::warn!("{error}; this is done once");
            renderer.recover()?;
            splat(&mut renderer, &cameras)?
        }
        splatted => splatted?,
    };
    let drawn = splatted
        .iter()
        .map(|picture| to_rgb(picture, picture.over(DUSK)))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let mut profile = Profile::default();
    profile.record_picture(&renderer.stage_times());
    let splatting = Splatting::new(renderer.back_end(), renderer.back_end_trial());
    let report = Report {
        background: scenery.figures,
        eye: camera.position().to_array(),
        vulkan_device: renderer.gpu().info().name.clone(),
        vulkan_driver: renderer.gpu().info().driver.clone(),
        runs: vec![StageTable::new(
            views,
            size,
            profile.summary(|_| Unit::Gpu),
            splatting,
        )],
        pictures: write_frame(&options.out, 0, &drawn)?,
    };
    report.background.print();
    println!("GPU          {}", describe(renderer.gpu()));
    report.runs.iter().for_each(StageTable::print);
    println!("\npictures");
    for picture in &report.pictures {
        println!("  {}", picture.display());
    }
    write_json(options.json.as_deref(), &report)
}

fn splat(renderer: &mut SplatRenderer, cameras: &[Camera]) -> Result<Vec<Image>, RenderError> {
    renderer.draw(cameras)?;
    let views = 0..renderer.views();
    views.map(|view| renderer.read_back(view)).collect()
}
