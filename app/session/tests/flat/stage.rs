//! A puppet, a session of it, and what it looks like.

use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::control::Control;
use app_pipeline::deform::Deformer;
use app_pipeline::inference::Inference;
use app_pipeline::placement::InferenceBackends;
use app_pipeline::plan::{PlacementRequest, Plan};
use app_pipeline::profile::Profile;
use app_pipeline::quality::QualityMode;
use app_pipeline::timeline::LatencyMode;
use app_session::display::{Display, DisplayNeeds};
use app_session::participant::Participant;
use app_session::session::{Session, SessionConfig, SessionReport};
use glam::{Affine3A, Quat, Vec3};
use npu_runtime::{Provider, ProviderKind, Runtime};
use renderer_splat::camera::Camera;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::Backdrop;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::{Gaussian, PackedGaussian};
use spmm3::networks::GraphParts;
use spmm3::{Avatar, Joint, MotionParams};
use std::sync::Arc;
use std::time::Duration;
use synthetic_person::Puppet;

/// Pixels of a picture's side.
pub(crate) const SIDE: u32 = 96;

pub(crate) const BLACK: Backdrop = Backdrop::Colour([0.0; 3]);

pub(crate) fn avatar() -> Arc<Avatar> {
    let bytes = Puppet::small().avatar().to_bytes().expect("a package");
    let avatar = Avatar::read(std::io::Cursor::new(bytes));
    Arc::new(avatar.expect("the package is sound"))
}

/// Arms swung by this angle, radians.
pub(crate) fn pose(swing: f32) -> MotionParams {
    let mut motion = MotionParams::default();
    motion.set_rotation(Joint::LeftShoulder, Quat::from_rotation_z(swing));
    motion.set_rotation(Joint::RightShoulder, Quat::from_rotation_y(swing));
    motion
}

/// From so far to the right, four metres before the origin.
pub(crate) fn camera(aside: f32) -> Camera {
    let (eye, target) = (Vec3::new(aside, 1.0, 4.0), Vec3::Y * 0.9);
    Camera::look_at(eye, target, Vec3::Y, 0.6, SIDE, SIDE)
}

pub(crate) fn needs(gpu: &Arc<Gpu>) -> DisplayNeeds {
    DisplayNeeds {
        gpu: Arc::clone(gpu),
        renderer: RendererOptions {
            back_end: Some(BackEnd::Tiles),
            ..RendererOptions::new(0, SIDE, SIDE, 1)
        },
        cameras: vec![camera(0.0)],
        period: Duration::from_millis(20),
    }
}

/// Nothing is compiled here.
static NOWHERE: CompiledSources = CompiledSources {
    cache: None,
    trusted: Vec::new(),
};

/// How this crate's sessions are shown in tests.
pub(crate) fn config(runtime: &Runtime, latency: LatencyMode) -> SessionConfig<'_> {
    SessionConfig {
        backends: InferenceBackends {
            runtime,
            threads: 1,
            compiled: &NOWHERE,
        },
        placement: PlacementRequest {
            plan: Some(Plan::CpuTail),
            provider: Some(ProviderKind::Cpu),
            ..PlacementRequest::default()
        },
        latency,
        quality: QualityMode::Fixed(0),
    }
}

pub(crate) fn run(
    runtime: &Runtime,
    latency: LatencyMode,
    participants: Vec<Participant>,
    display: &mut dyn Display,
) -> SessionReport {
    let config = config(runtime, latency);
    let session = Session::new(config, participants, Control::default());
    session.run(display).expect("a session")
}

/// A person in a pose at a place.
pub(crate) fn expected(
    (gpu, runtime): (&Arc<Gpu>, &Runtime),
    people: &[(MotionParams, Affine3A)],
    camera: Camera,
) -> Vec<u8> {
    let (avatar, plan) = (avatar(), Plan::CpuTail);
    let provider = Provider::Cpu { threads: 1 };
    let inference = Inference::open(
        runtime,
        &avatar,
        GraphParts::Skinned,
        &[provider],
        &CompiledSources::default(),
    );
    let inference = inference.expect("a session");
    let mut deformer = Deformer::new(&avatar, inference, plan).expect("a deformer");
    let mut all = Vec::new();
    for (motion, place) in people {
        let state = deformer.deform(motion, &mut Profile::default());
        let packed = state.expect("deformed").packed();
        all.extend(packed.iter().map(|one| carried(one, *place)));
    }
    let options = RendererOptions {
        back_end: Some(BackEnd::Tiles),
        ..RendererOptions::new(u32::try_from(all.len()).expect("few"), SIDE, SIDE, 1)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer");
    renderer.set_foreground(&all).expect("they fit");
    renderer.draw(&[camera]).expect("a picture");
    renderer.read_back(0).expect("a picture").over(BLACK)
}

fn carried(gaussian: &PackedGaussian, world_from_person: Affine3A) -> PackedGaussian {
    let gaussian = gaussian.unpacked();
    let (_, turn, _) = world_from_person.to_scale_rotation_translation();
    let at = Vec3::from_array(gaussian.position);
    PackedGaussian::from(&Gaussian {
        position: world_from_person.transform_point3(at).to_array(),
        rotation: (turn * Quat::from_array(gaussian.rotation)).to_array(),
        ..gaussian
    })
}

/// In dB.
pub(crate) fn psnr(one: &[u8], other: &[u8]) -> f64 {
    assert_eq!(one.len(), other.len(), "one size");
    let squares = (one.iter().zip(other)).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
    let mean = squares.sum::<f64>() / one.len() as f64;
    10.0 * (255.0 * 255.0 / mean.max(1e-9)).log10()
}
