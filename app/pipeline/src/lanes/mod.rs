//! Three units at once: a lane for each, which never waits for another.
//!
//! ```text
//! motion   pose, kinematics ──▶ NPU   deform graph ──▶ CPU   states of Gaussians
//!                                                            interpolation at the display's time ──▶ GPU   picture
//! ```
//! Results are handed on through places that were allocated before (`triple_buffer.rs`): a slower lane takes the newest and
//! leaves the rest out, and what is left out is counted. Each person has their own motion, NPU and CPU lane (`person.rs`). The
//! GPU's lane is the thread that calls [`Lanes`], which is the display's, and draws all of them in one sort (`picture.rs`); it
//! asks for the next picture's Gaussians before it draws this one's, so that the CPU makes them meanwhile. What is told of
//! pictures (`shown.rs`) is recorded for each person.

mod costly;
mod cpu;
mod device;
mod display;
mod motion;
mod npu;
mod pausable;
mod people;
mod person;
mod picture;
mod recovery;
mod scenery;
mod shown;
mod start;
mod states;
mod threads;
mod triple_buffer;
mod visibility;

pub use costly::LeftOut;
pub use display::{DisplayClock, Next, Tick};
pub use motion::{MotionSource, Pose};
pub use pausable::PausableSource;
pub use people::{Joined, MOST_PEOPLE};
pub use person::FinishedPerson;
pub use triple_buffer::{Reader, WakeSignal, Writer, triple_buffer};
pub use visibility::Visibility;

use crate::plan::Plan;
use crate::profile::Collector;
use crate::quality::{Quality, QualityController, QualityFigures, QualityMode};
use crate::timeline::LatencyMode;
use costly::SlowPictures;
use people::People;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use scenery::Scenery;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What lanes are started with.
#[derive(Debug)]
pub struct LaneOptions {
    /// How stages are divided among the units, for the first person.
    pub plan: Plan,
    /// What is done about the time from one motion frame to the next.
    pub latency: LatencyMode,
    /// What is done when the GPU cannot hold the display's rate.
    pub quality: QualityMode,
    /// From one vertical blank of the display to the next.
    pub display_period: Duration,
    /// What a picture at full quality took the GPU when placements were tried; nothing where that is not known.
    pub expected_picture: Option<Duration>,
}

/// What was left out because a newer one had come, by the lane that would have taken it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Skipped {
    /// Poses that the NPU lane never saw.
    pub poses: u64,
    /// Inferences that the CPU lane never made states of.
    pub inferences: u64,
    /// Pictures that the CPU lane was asked for and had no time to interpolate.
    pub requests: u64,
    /// Interpolated Gaussians that the GPU lane never drew.
    pub interpolations: u64,
}

/// What was drawn.
#[derive(Debug)]
pub enum Drawn {
    /// The picture; it is in the renderer, or in the headset's images that it was drawn onto.
    Picture,
    /// None: the device was lost, and another has been opened. Show the next picture on that one.
    Renewed(Arc<Gpu>),
    /// None: the device was lost, and only the headset's runtime, which made it, can make another. Give that one to
    /// [`Lanes::move_to`]; until then people move on unseen.
    Lost,
}

/// The lanes of all who are shown, and the renderer.
#[derive(Debug)]
pub struct Lanes<S: MotionSource> {
    people: People<S>,
    latency: LatencyMode,
    renderer: SplatRenderer,
    /// The renderer's device was lost, and the next one has not come yet.
    is_lost: bool,
    scenery: Scenery,
    controller: QualityController,
    /// What the picture being made is drawn with.
    quality: Quality,
    slow: SlowPictures,
    displayed: Option<Instant>,
    number: u64,
    drawing: Option<Progress>,
}

/// A picture on its way.
#[derive(Debug, Clone, Copy)]
struct Progress {
    tick: Tick,
    begun: Instant,
    sorted: Instant,
    drawn: Instant,
}

impl<S: MotionSource> Lanes<S> {
    /// What was done to hold the display's rate so far.
    #[must_use]
    pub fn quality_figures(&self) -> QualityFigures {
        self.controller.figures()
    }

    /// What the first person's lanes and the GPU's recorded.
    pub fn collector(&mut self) -> &mut Collector {
        let collector = &mut self.people.first.collector;
        collector.collect();
        collector
    }

    /// The renderer, which holds the last picture.
    pub fn renderer(&mut self) -> &mut SplatRenderer {
        &mut self.renderer
    }
}
