//! `mon3tr-dev bench lanes`: what handing over from lane to lane costs, and how near pictures by all lanes at once come to the
//! slowest unit alone.
//!
//! NetworkContext are taken by turns in one process, so that whatever else the machine does slows all alike.

mod clip;
mod format;
mod one_by_one;
mod triple_buffer;
mod turn;

use app_pipeline::control::Control;
use app_pipeline::placement::{InferenceBackends, Placed, place};
use app_pipeline::plan::{PlacementRequest, Plan};
use app_pipeline::posing::bound_mesh_with_networks;
use format::Format;
use mon3tr::commands::bake::{BakeChoices, chosen_or_demo_avatar};
use mon3tr::device_options::{DeviceOptions, compiled, describe};
use mon3tr::network::parse_seconds;
use mon3tr::performance::MotionOptions;
use mon3tr::report::{check_writable, write_json};
use mon3tr::size::{Size, Views};
use mon3tr::stills::{RenderSettings, load_avatar};
use mon3tr::viewpoint::{Viewpoint, eyes};
use profile_report::AvatarFigures;
use renderer_splat::options::{Filter, RendererOptions};
use renderer_splat::renderer::SplatRenderer;
use serde::Serialize;
use spmm3::MotionParams;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use triple_buffer::HandOver;
use turn::Scene;

/// A window's picture and a headset's.
const FORMATS: [(Size, Views); 2] = [(square(640), Views::Mono), (square(1024), Views::Stereo)];

/// Where the person is seen from.
const CAMERA: &str = "front";

const fn square(side: u32) -> Size {
    Size {
        width: side,
        height: side,
    }
}

/// Options of `bench lanes`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The avatar's package [default: the demo avatar, baked if the cache has none]
    #[arg(value_name = "PKG")]
    avatar: Option<PathBuf>,
    #[command(flatten)]
    motion: MotionOptions,
    /// What runs where, as `profile` takes it
    #[arg(long, value_name = "PLACEMENT", default_value = "auto")]
    placement: PlacementRequest,
    /// Turns of each way to take the median of
    #[arg(long, value_name = "K", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    turns: u32,
    /// How long a turn is measured, after a second that is not
    #[arg(long, value_name = "SECONDS", default_value = "3", value_parser = parse_seconds)]
    seconds: Duration,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    bake: BakeChoices,
}

#[derive(Debug, Serialize)]
struct Measured {
    avatar: AvatarFigures,
    motion: String,
    device: String,
    onnx_runtime: String,
    cores: usize,
    hand_over: [HandOver; 2],
    formats: Vec<Format>,
}

/// Runs `bench lanes`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    options.motion.check()?;
    let gpu = device.gpu()?;
    let runtime = device.runtime()?;
    let package = chosen_or_demo_avatar(options.avatar.as_deref(), &options.bake, device)?;
    let (avatar, figures) = load_avatar(&package)?;
    let performance = options.motion.load(&avatar)?;
    let frames: Arc<[MotionParams]> = performance.frames.clone().into();
    let hand_over = triple_buffer::measure()?;
    triple_buffer::print(&hand_over);
    let mut measured = Measured {
        avatar: figures,
        motion: performance.name.clone(),
        device: describe(&gpu),
        onnx_runtime: runtime.version().to_owned(),
        cores: DeviceOptions::threads(),
        hand_over,
        formats: Vec::new(),
    };
    println!(
        "\nPictures: {} of {} Gaussians, motion {} at 30 Hz, {}, ONNX Runtime {}",
        measured.avatar.name,
        measured.avatar.gaussians,
        measured.motion,
        measured.device,
        measured.onnx_runtime
    );
    let compiled = compiled()?;
    let may_pose = (options.placement.plan).is_none_or(Plan::poses_on_device);
    let mesh = may_pose
        .then(|| bound_mesh_with_networks(&avatar))
        .transpose()?
        .map(Arc::new);
    for (size, views) in FORMATS {
        let setting = RenderSettings {
            size,
            views,
            background: None,
            filter: Filter::Dilation,
        };
        let renderer_options = RendererOptions {
            mesh: mesh.clone(),
            ..setting.renderer(avatar.gaussians.len())?
        };
        let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &renderer_options)?;
        let viewpoint: Viewpoint = CAMERA.parse().map_err(anyhow::Error::msg)?;
        let camera = viewpoint.camera(
            performance.start(&avatar),
            performance.heading(),
            size.width,
            size.height,
        );
        let backends = InferenceBackends {
            runtime: &runtime,
            threads: measured.cores,
            compiled: &compiled,
        };
        let cameras = eyes(camera, views);
        let Placed { plan, report, .. } = place(
            &backends,
            &avatar,
            &mut renderer,
            &cameras,
            options.placement,
            &Control::default(),
        )?;
        let scene = Scene {
            gpu: &gpu,
            runtime: &runtime,
            compiled: &compiled,
            avatar: &avatar,
            frames: &frames,
            viewpoint,
            heading: performance.heading(),
            setting,
            plan,
            provider: report.provider,
            units: report.units(),
            back_end: renderer.back_end(),
            mesh: mesh.clone().filter(|_| plan.poses_on_device()),
            seconds: options.seconds,
        };
        drop(renderer);
        let (mut alone, mut together) = (Vec::new(), Vec::new());
        for _ in 0..options.turns {
            alone.push(scene.one_by_one()?);
            together.push(scene.at_once()?);
        }
        let format = Format::new(&scene, report, &alone, together);
        format.print();
        measured.formats.push(format);
    }
    write_json(options.json.as_deref(), &measured)
}
