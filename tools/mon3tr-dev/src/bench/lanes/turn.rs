//! What every turn has in common: avatar, motion, cameras, placement, renderer; and a turn by lanes that work at once.

use super::clip::Clip;
use anyhow::{Context, ensure};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::inference::Inference;
use app_pipeline::lanes::{DisplayClock, Drawn, FinishedPerson, LaneOptions, Lanes, Skipped};
use app_pipeline::plan::Plan;
use app_pipeline::profile::{Recording, Summary, Terms};
use app_pipeline::quality::QualityMode;
use app_pipeline::stage::{Stage, Unit};
use app_pipeline::timeline::LatencyMode;
use glam::{Quat, Vec3};
use mon3tr::performance::MOTION_RATE;
use mon3tr::stills::RenderSettings;
use mon3tr::viewpoint::{Viewpoint, eyes};
use npu_runtime::{Provider, Runtime};
use renderer_splat::camera::Camera;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::posing::BoundMesh;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use spmm3::{Avatar, Joint, MotionParams};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Of every turn, before measuring begins.
pub(super) const WARM_UP: Duration = Duration::from_secs(1);
/// Blanks follow each other so closely that no lane waits for one.
const DISPLAY_HZ: f64 = 1000.0;

/// What both ways have in common.
#[derive(Debug)]
pub(super) struct Scene<'a> {
    pub(super) gpu: &'a Arc<Gpu>,
    pub(super) runtime: &'a Runtime,
    pub(super) compiled: &'a CompiledSources,
    pub(super) avatar: &'a Arc<Avatar>,
    pub(super) frames: &'a Arc<[MotionParams]>,
    pub(super) viewpoint: Viewpoint,
    pub(super) heading: Quat,
    pub(super) setting: RenderSettings,
    pub(super) plan: Plan,
    pub(super) provider: Option<Provider>,
    pub(super) units: [Unit; Stage::ALL.len()],
    pub(super) back_end: BackEnd,
    /// Where Gaussians are made on the device.
    pub(super) mesh: Option<Arc<BoundMesh>>,
    pub(super) seconds: Duration,
}

/// What lanes took.
#[derive(Debug)]
pub(super) struct AtOnce {
    pub(super) summary: Summary,
    pub(super) picture_ms: f64,
    pub(super) skipped: Skipped,
}

impl Scene<'_> {
    /// With the person in the middle, as `motion` has them.
    pub(super) fn cameras(&self, motion: &MotionParams) -> Vec<Camera> {
        let pelvis = self.avatar.skeleton.rest_positions()[Joint::Pelvis.index()];
        let floor = Vec3::new(1.0, 0.0, 1.0) * (motion.root_translation + pelvis);
        let size = self.setting.size;
        let camera = (self.viewpoint).camera(floor, self.heading, size.width, size.height);
        eyes(camera, self.setting.views)
    }

    /// What the plan leaves to ONNX Runtime; nothing where the device does all of it.
    pub(super) fn inference(&self) -> anyhow::Result<Option<Inference>> {
        let (Some(graph), Some(provider)) = (self.plan.graph(), self.provider) else {
            return Ok(None);
        };
        let (runtime, avatar) = (self.runtime, self.avatar);
        let opened = Inference::open(runtime, avatar, graph, &[provider], self.compiled);
        Ok(Some(opened?))
    }

    pub(super) fn renderer(&self) -> anyhow::Result<SplatRenderer> {
        let options = RendererOptions {
            back_end: Some(self.back_end),
            mesh: self.mesh.clone(),
            ..self.setting.renderer(self.avatar.gaussians.len())?
        };
        SplatRenderer::new(Arc::clone(self.gpu), &options).context("cannot prepare the renderer")
    }

    /// Lanes, as in a call.
    pub(super) fn at_once(&self) -> anyhow::Result<AtOnce> {
        let mut display = DisplayClock::new(DISPLAY_HZ);
        let options = LaneOptions {
            plan: self.plan,
            latency: LatencyMode::Interpolate,
            // Every picture as good as the first, however long it takes.
            quality: QualityMode::Fixed(0),
            display_period: display.period(),
            expected_picture: None,
        };
        let clip = Clip::new(self.frames);
        let (inference, renderer) = (self.inference()?, self.renderer()?);
        let mut lanes = Lanes::start(self.avatar, inference, renderer, clip, &options)?;
        let mut measured: Option<[Instant; 2]> = None;
        loop {
            let begun = Instant::now();
            if measured.is_some_and(|[_, end]| begun >= end) {
                break;
            }
            let Some(motion) = lanes.begin(display.tick(begun))?.cloned() else {
                std::thread::sleep(Duration::from_millis(1));
                continue;
            };
            let begin = begun + WARM_UP;
            measured.get_or_insert([begin, begin + self.seconds]);
            if let Drawn::Picture = lanes.draw(&self.cameras(&motion))? {
                let shown = display.drawn(begun, Instant::now());
                lanes.displayed(shown);
            }
        }
        let [begin, end] = measured.context("nothing was drawn")?;
        let skipped = lanes.skipped();
        let FinishedPerson {
            error, collector, ..
        } = lanes.finish().swap_remove(0);
        error.map_or(Ok(()), Err)?;
        let terms = Terms {
            display_period: display.period(),
            motion_hz: MOTION_RATE,
            units: self.units,
            encode: None,
            lost_events: collector.lost(),
        };
        let recording = Recording::new(&collector, begin, end);
        let new = recording.pictures.iter().filter(|one| !one.repeated);
        let pictures = new.count();
        ensure!(
            pictures > 0,
            "no picture in {} s: measure for longer",
            self.seconds.as_secs()
        );
        let summary = Summary::new(&recording, &terms);
        Ok(AtOnce {
            picture_ms: summary.seconds * 1e3 / pictures as f64,
            summary,
            skipped,
        })
    }
}
