//! Everybody in one headset: their stages are placed, their lanes started, and they are shown until it is over.

use super::figures::HeadsetFigures;
use super::show::{FrameObserver, HeadsetError, PresentConfig, open_again, show};
use crate::call::CallWatch;
use crate::overlay::OverlayWatch;
use app_pipeline::control::Control;
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::PausableSource;
use app_pipeline::lanes::{LaneOptions, Lanes, MotionSource, Skipped};
use app_pipeline::placement::{InferenceBackends, Placed, PlacementReport, place, place_first};
use app_pipeline::plan::{PlacementRequest, Plan};
use app_pipeline::profile::Collector;
use app_pipeline::quality::{QualityFigures, QualityMode};
use app_pipeline::timeline::LatencyMode;
use glam::Vec3;
use renderer_openxr::error::XrError;
use renderer_openxr::headset::{Headset, HeadsetOptions};
use renderer_openxr::runtime::Runtime;
use renderer_openxr::session::SessionOptions;
use renderer_splat::back_ends::BackEndTrial;
use renderer_splat::background::Background;
use renderer_splat::camera::Camera;
use renderer_splat::options::{BackEnd, Filter, RendererOptions};
use spmm3::Avatar;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Gaussians beside the people's: their shadows.
const BESIDE: u32 = 256;
/// Until a headset says its rate.
const HERTZ: f32 = 72.0;

/// A headset that is there, and how to have it again when it went.
#[derive(Debug)]
pub struct HeadsetHandle {
    runtime: Runtime,
    headset: Headset,
    options: HeadsetOptions,
}

impl HeadsetHandle {
    /// Opens a runtime's headset.
    ///
    /// # Errors
    /// As [`Headset::open`].
    pub fn open(runtime: Runtime, options: HeadsetOptions) -> Result<Self, XrError> {
        let headset = Headset::open(&runtime, options)?;
        Ok(Self {
            runtime,
            headset,
            options,
        })
    }

    /// The headset.
    #[must_use]
    pub fn headset(&self) -> &Headset {
        &self.headset
    }

    /// Opens it again after it went; nothing if it is time to leave before. What is left of it goes first: a loader has one instance
    /// at a time.
    pub(super) fn open_again(self, control: &Control, is_over: &dyn Fn() -> bool) -> Option<Self> {
        let Self {
            runtime,
            headset,
            options,
        } = self;
        close(headset, control);
        let headset = open_again(&runtime, options, control, is_over)?;
        Some(Self {
            runtime,
            headset,
            options,
        })
    }
}

/// Frees a headset, and with it its device, in a step of the GPU's.
pub(super) fn close<T>(headset: T, control: &Control) {
    let step = control.step();
    drop(headset);
    drop(step);
}

/// How people are to be shown.
#[derive(Debug, Clone)]
pub struct Wishes {
    /// What runs where.
    pub placement: PlacementRequest,
    /// What is done about the time from one motion frame to the next.
    pub latency: LatencyMode,
    /// What is done when the GPU cannot hold the display's rate.
    pub hold: QualityMode,
    /// What stands around them, and how it is filtered; without it the viewer's own room, or a studio.
    pub scene: Option<(Arc<Background>, Filter)>,
    /// Whether eyes' pictures will be read back.
    pub read_back: bool,
    /// The display's rate that is asked for, and kept, Hz; without it 72, and more where frames keep up.
    pub display_hz: Option<f32>,
}

/// Who is to be shown.
#[derive(Debug)]
pub struct Gathered<S> {
    /// Where each one's poses come from, in the order of their avatars.
    pub sources: Vec<S>,
    /// What the network brings of the first one's.
    pub watch: Option<CallWatch>,
}

/// What is left when it is over.
#[derive(Debug)]
pub struct Party<S> {
    /// Each one's source of poses, or what ended a lane of theirs.
    pub sources: Vec<Result<S, ReceiverError>>,
    /// What the first one's lanes told.
    pub collector: Collector,
    /// The headset's own.
    pub headset: HeadsetFigures,
    /// What ran where, of the first one.
    pub placement: PlacementReport,
    /// What was left out.
    pub skipped: Skipped,
    /// What was given up to hold the rate.
    pub hold: QualityFigures,
    /// What drew ...
    pub back_end: BackEnd,
    /// ... and why.
    pub back_end_trial: Option<BackEndTrial>,
    /// When showing began.
    pub began: Instant,
}

impl<S> Party<S> {
    /// The sources by themselves.
    pub(crate) fn without_sources(self) -> (Vec<Result<S, ReceiverError>>, Party<()>) {
        let rest = Party {
            sources: Vec::new(),
            collector: self.collector,
            headset: self.headset,
            placement: self.placement,
            skipped: self.skipped,
            hold: self.hold,
            back_end: self.back_end,
            back_end_trial: self.back_end_trial,
            began: self.began,
        };
        (self.sources, rest)
    }

    /// The display's period, as far as it is known.
    #[must_use]
    pub fn display_period(&self) -> Duration {
        let hertz = self.headset.display_hz.unwrap_or(HERTZ);
        Duration::from_secs_f32(1.0 / hertz.max(1.0))
    }
}

/// Prepares everything for `avatars`, has `join` gather their poses only then, for nobody is to wait for that in a call, and
/// shows them until it is over. `backends` is what this machine runs graphs with. `control` may interrupt the preparations between any
/// two steps.
///
/// # Errors
/// If nothing can run or draw them, or the headset cannot be shown anything. [`HeadsetError::Left`] where `control` ends it before
/// anybody is joined.
pub fn show_party<S: MotionSource>(
    found: HeadsetHandle,
    backends: &InferenceBackends<'_>,
    wishes: &Wishes,
    avatars: &[Arc<Avatar>],
    join: impl FnOnce() -> Gathered<S>,
    control: &Control,
    watcher: &mut dyn FrameObserver,
) -> Result<Party<S>, HeadsetError> {
    let Some((first, others)) = avatars.split_first() else {
        return Err(HeadsetError::Nobody);
    };
    let HeadsetHandle {
        runtime,
        headset,
        options,
    } = found;
    let cameras = eyes_before(headset.info().eye_size);
    let (placed, mut renderer) = place_first(
        backends,
        first,
        headset.gpu(),
        renderer_options(&headset, avatars, wishes),
        &cameras,
        wishes.placement,
        control,
    )?;
    let Placed {
        plan,
        inference,
        report: mut placement,
    } = placed;
    // Only one person's Gaussians can stay on the device.
    let for_others = PlacementRequest {
        plan: Some(if plan == Plan::Gpu { Plan::Cpu } else { plan }),
        ..wishes.placement
    };
    let mut placed_others = Vec::new();
    for avatar in others {
        placed_others.push(place(
            backends,
            avatar,
            &mut renderer,
            &cameras,
            for_others,
            control,
        )?);
    }
    let lane_options = LaneOptions {
        plan,
        latency: wishes.latency,
        hold: wishes.hold,
        display_period: Duration::from_secs_f32(1.0 / HERTZ),
    };
    control.checkpoint()?;
    let Gathered { sources, watch } = join();
    let mut sources =
        (sources.into_iter()).map(|source| PausableSource::new(source, control.clone()));
    let source = sources.next().ok_or(HeadsetError::Nobody)?;
    // Also when it is time to leave: the calls that were joined say goodbye at their end.
    let step = control.step();
    let mut lanes = Lanes::start(first, inference, renderer, source, &lane_options)?;
    for ((avatar, placed), source) in others.iter().zip(placed_others).zip(sources) {
        lanes.join(avatar, placed.inference, source, placed.plan)?;
    }
    drop(step);
    let showing = PresentConfig {
        runtime,
        options,
        session: SessionOptions {
            // Who gives a scene wants to see it.
            room: wishes.scene.is_none(),
            read_back: wishes.read_back,
            display_hz: wishes.display_hz,
        },
        skeletons: (avatars.iter())
            .map(|avatar| avatar.skeleton.clone())
            .collect(),
        overlay: OverlayWatch::new(placement.clone(), watch),
        control: control.clone(),
    };
    let began = Instant::now();
    let headset = show(&mut lanes, headset, showing, watcher)?;
    // All that is on the device is freed now.
    let step = control.step();
    placement.follow(lanes.provider_changes());
    let renderer = lanes.renderer();
    let (back_end, back_end_trial) = (renderer.back_end(), renderer.back_end_trial());
    let (skipped, hold) = (lanes.skipped(), lanes.hold());
    let (sources, collector) = lanes.finish_all();
    drop(step);
    Ok(Party {
        sources: (sources.into_iter())
            .map(|source| source.map(PausableSource::into_source))
            .collect(),
        collector,
        headset,
        placement,
        skipped,
        hold,
        back_end,
        back_end_trial,
        began,
    })
}

/// For a renderer of everybody, in pictures of the headset's size.
fn renderer_options(
    headset: &Headset,
    avatars: &[Arc<Avatar>],
    wishes: &Wishes,
) -> RendererOptions {
    let [width, height] = headset.info().eye_size;
    let people = (avatars.iter()).fold(BESIDE, |sum, avatar| {
        sum.saturating_add(u32::try_from(avatar.gaussians.len()).unwrap_or(u32::MAX))
    });
    let (background, filter) = match &wishes.scene {
        Some((background, filter)) => (Some(Arc::clone(background)), *filter),
        None => (None, Filter::Dilation),
    };
    RendererOptions {
        background,
        filter,
        depth: (headset.extensions()).has("XR_KHR_composition_layer_depth"),
        ..RendererOptions::new(people, width, height, 2)
    }
}

/// Eyes as they will see the first person, to find out what is fastest.
fn eyes_before([width, height]: [u32; 2]) -> [Camera; 2] {
    [-0.0315, 0.0315].map(|x| {
        let eye = Vec3::new(x, 1.6, 1.6);
        Camera::look_at(eye, eye - Vec3::Z, Vec3::Y, 1.6, width, height)
    })
}
