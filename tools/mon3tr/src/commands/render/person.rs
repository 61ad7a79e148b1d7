//! An avatar follows a motion; every frame a PNG, and one animation.

use super::{Options, write_frame};
use crate::device_options::DeviceOptions;
use crate::film::Film;
use crate::performance::MOTION_RATE;
use crate::progress;
use crate::report::{RunReport, write_json};
use crate::scenery::Scenery;
use crate::stills::{RenderSettings, StillRenderer, load_avatar};
use crate::viewpoint::{CameraChoice, eyes};
use anyhow::Context;
use app_session::display::Still;
use renderer_splat::options::Filter;
use std::path::Path;
use std::time::Duration;

pub(super) fn run(options: &Options, package: &Path, device: &DeviceOptions) -> anyhow::Result<()> {
    let (avatar, figures) = load_avatar(package)?;
    let performance = options.motion.load(&avatar)?;
    let heading = performance.heading();
    let scenery =
        options
            .scenery
            .around(options.camera_file(), performance.start(&avatar), heading)?;
    let scene_camera = options.scene_camera()?;
    let size = options.size(scene_camera.as_ref())?;
    let fixed = match (&scene_camera, &scenery) {
        (Some(camera), Some(scenery)) => Some(scenery.camera(camera, size)),
        _ => None,
    };
    let runtime = device.runtime()?;
    let gpu = device.gpu()?;
    options.prepare_output()?;

    let default_filter = scenery.as_ref().map_or(Filter::Dilation, Scenery::filter);
    let setting = RenderSettings {
        size,
        views: options.views(),
        background: scenery.as_ref().map(|scenery| scenery.background.clone()),
        filter: options.filter.map_or(default_filter, Into::into),
    };
    let heights = || avatar.template.vertices().iter().map(|v| v[1]);
    let tall =
        heights().fold(f32::NEG_INFINITY, f32::max) - heights().fold(f32::INFINITY, f32::min);
    let mut stills = Vec::new();
    for (motion, floor) in performance.followed(&avatar) {
        let camera = match (&options.view, fixed) {
            (CameraChoice::Named(viewpoint), _) => {
                (viewpoint.of_height(tall)).camera(floor, heading, size.width, size.height)
            }
            (CameraChoice::Exact(viewpoint), _) => {
                viewpoint.camera(floor, heading, size.width, size.height)
            }
            (CameraChoice::File(_), fixed) => fixed.context("the scene's camera is missing")?,
        };
        stills.push(Still {
            motion: motion.clone(),
            cameras: eyes(camera, options.views()),
        });
    }
    let renderer = StillRenderer {
        gpu: &gpu,
        runtime: &runtime,
        avatar: &avatar,
    };
    let mut film = Film::start(options.out.join("animation.webp"));
    let bar = progress::bar("drawing", performance.frames.len());
    let mut pictures = Vec::new();
    let stills = renderer.draw(&setting, stills, |k, drawn| {
        pictures.extend(write_frame(&options.out, k, &drawn)?);
        film.add(
            drawn
                .into_iter()
                .next()
                .context("the renderer returned no picture")?,
            Duration::from_secs_f64(k as f64 / MOTION_RATE),
        );
        bar.inc(1);
        Ok(())
    })?;
    bar.finish_and_clear();
    pictures.insert(0, film.finish()?);

    let runs = vec![stills.times];
    let mut report = RunReport::new(figures, &performance, &stills.gpu, &runtime, runs, pictures);
    report.background = scenery.map(|scenery| scenery.figures);
    report.print();
    write_json(options.json.as_deref(), &report)
}
