//! A call on screen: its lanes, its display, and a camera that keeps to the person.

use crate::device_options::{compiled, inference_backends};
use crate::lanes::LaneChoices;
use crate::stills::RenderSettings;
use crate::viewpoint::{Viewpoint, eyes};
use anyhow::Context;
use app_pipeline::control::Control;
use app_pipeline::lanes::{DisplayClock, Drawn, LaneOptions, Lanes, Skipped};
use app_pipeline::placement::{Placed, PlacementReport, place_first};
use app_pipeline::profile::Collector;
use app_pipeline::quality::{QualityFigures, QualityMode};
use app_session::call::Call;
use glam::{Quat, Vec3};
use npu_runtime::Runtime;
use renderer_splat::camera::Camera;
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use spmm3::{Avatar, Joint, MotionParams};
use std::sync::Arc;
use std::time::Instant;

/// Share of the way to the person that the camera makes up in a second: it must not sway with every step.
const FOLLOW: f32 = 3.8;

/// All that a call needs to be drawn, ready before its first frame comes: stages are placed, graphs loaded, both of the
/// renderer's back ends tried. Nobody is to wait for that in the call.
#[derive(Debug)]
pub(crate) struct PreparedView {
    avatar: Arc<Avatar>,
    placed: Placed,
    renderer: SplatRenderer,
    setting: RenderSettings,
    choices: LaneChoices,
}

impl PreparedView {
    /// For an avatar on a device.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        runtime: &Runtime,
        avatar: &Arc<Avatar>,
        setting: RenderSettings,
        viewpoint: &Viewpoint,
        choices: LaneChoices,
    ) -> anyhow::Result<Self> {
        let camera = viewpoint.camera(
            Vec3::ZERO,
            Quat::IDENTITY,
            setting.size.width,
            setting.size.height,
        );
        let options = setting.renderer(avatar.gaussians.len())?;
        let cameras = eyes(camera, setting.views);
        let compiled = compiled()?;
        let backends = inference_backends(runtime, &compiled);
        let (placed, renderer) = place_first(
            &backends,
            avatar,
            gpu,
            options,
            &cameras,
            choices.placement,
            &Control::default(),
        )?;
        Ok(Self {
            avatar: Arc::clone(avatar),
            placed,
            renderer,
            setting,
            choices,
        })
    }

    /// Begins to show `call` on a display of so many pictures a second.
    pub(crate) fn show(
        self,
        call: Call,
        hertz: f64,
        hold: QualityMode,
    ) -> anyhow::Result<LiveView> {
        let display = DisplayClock::new(hertz);
        let Placed {
            plan,
            inference,
            report,
        } = self.placed;
        let options = LaneOptions {
            plan,
            latency: self.choices.latency.into(),
            hold,
            display_period: display.period(),
        };
        let pelvis = self.avatar.skeleton.rest_positions()[Joint::Pelvis.index()];
        let lanes = Lanes::start(&self.avatar, inference, self.renderer, call, &options)?;
        Ok(LiveView {
            lanes,
            display,
            begun: Instant::now(),
            avatar: self.avatar,
            placement: report,
            setting: self.setting,
            pelvis,
            followed: None,
        })
    }
}

/// A call, seen from where its person stands.
#[derive(Debug)]
pub(crate) struct LiveView {
    pub(crate) lanes: Lanes<Call>,
    pub(crate) display: DisplayClock,
    pub(crate) placement: PlacementReport,
    avatar: Arc<Avatar>,
    setting: RenderSettings,
    begun: Instant,
    pelvis: Vec3,
    followed: Option<Followed>,
}

#[derive(Debug, Clone, Copy)]
struct Followed {
    floor: Vec3,
    heading: Quat,
    at: Instant,
}

/// What there is to show at one moment.
#[derive(Debug)]
pub(crate) struct Moment {
    pub(crate) motion: MotionParams,
    /// Where the camera takes the person to stand, metres on the floor.
    pub(crate) floor: Vec3,
    /// Which way the person faced at first, as a turn about y from +z.
    pub(crate) heading: Quat,
}

/// What is left of a call that was shown.
#[derive(Debug)]
pub(crate) struct ViewReport {
    pub(crate) call: Call,
    pub(crate) collector: Collector,
    pub(crate) placement: PlacementReport,
    pub(crate) skipped: Skipped,
    pub(crate) hold: QualityFigures,
}

impl LiveView {
    /// Begins the picture that is due now; `None` until there is somebody to be seen.
    pub(crate) fn begin(&mut self) -> anyhow::Result<Option<Moment>> {
        self.begun = Instant::now();
        let tick = self.display.tick(self.begun);
        let Some(motion) = self.lanes.begin(tick)?.cloned() else {
            return Ok(None);
        };
        let stands = Vec3::new(1.0, 0.0, 1.0) * (motion.root_translation + self.pelvis);
        let followed = self.followed.get_or_insert_with(|| {
            let forward = motion.rotation(Joint::Pelvis) * Vec3::Z;
            Followed {
                floor: stands,
                heading: Quat::from_rotation_y(forward.x.atan2(forward.z)),
                at: self.begun,
            }
        });
        let elapsed = self.begun.duration_since(followed.at).as_secs_f32();
        followed.floor += (stands - followed.floor) * (1.0 - (-FOLLOW * elapsed).exp());
        followed.at = self.begun;
        Ok(Some(Moment {
            motion,
            floor: followed.floor,
            heading: followed.heading,
        }))
    }

    /// Draws it as `camera` sees it, or the eyes beside it.
    pub(crate) fn draw(&mut self, camera: Camera) -> anyhow::Result<Drawn> {
        Ok(self.lanes.draw(&eyes(camera, self.setting.views))?)
    }

    /// Takes note that the picture is on its way to the display.
    pub(crate) fn displayed(&mut self) {
        let shown = self.display.drawn(self.begun, Instant::now());
        self.lanes.displayed(shown);
    }

    /// What pictures are made.
    pub(crate) fn setting(&self) -> &RenderSettings {
        &self.setting
    }

    /// Makes other pictures from now on.
    pub(crate) fn set(&mut self, setting: RenderSettings) -> anyhow::Result<()> {
        let renderer = self.lanes.renderer();
        let options = RendererOptions {
            mesh: renderer.options().mesh.clone(),
            // The faster one has been found.
            back_end: Some(renderer.back_end()),
            ..setting.renderer(self.avatar.gaussians.len())?
        };
        let gpu = Arc::clone(renderer.gpu());
        let renderer = SplatRenderer::new(gpu, &options).context("cannot prepare the renderer")?;
        self.lanes.replace_renderer(renderer)?;
        self.setting = setting;
        Ok(())
    }

    /// The person who is shown.
    pub(crate) fn avatar(&self) -> &Arc<Avatar> {
        &self.avatar
    }

    /// Ends the lanes; the call goes on until it is hung up.
    pub(crate) fn finish(mut self) -> anyhow::Result<ViewReport> {
        self.placement.follow(self.lanes.provider_changes());
        let (skipped, hold) = (self.lanes.skipped(), self.lanes.hold());
        let (call, collector) = self.lanes.finish()?;
        Ok(ViewReport {
            call,
            collector,
            placement: self.placement,
            skipped,
            hold,
        })
    }
}
