//! The motion lane: poses as they come, from a call or a clip, and the kinematics of each.

use super::Visibility;
use super::triple_buffer::Writer;
use crate::concealment::ConcealmentState;
use crate::profile::{FrameTimes, Recorder};
use crate::stage::Stage;
use crate::timeline::DisplayLag;
use spmm3::{MotionParams, Skeleton, SkinningTransforms};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// How long a source may keep the lane from seeing that it is to stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// A pose to deform the avatar to.
#[derive(Debug, Clone)]
pub struct Pose {
    /// The 215 motion parameters and the root translation.
    pub motion: MotionParams,
    /// Where it came from, and when.
    pub times: FrameTimes,
}

/// Where poses come from.
pub trait MotionSource: Send + 'static {
    /// Waits for the next pose, `longest` at most.
    fn next(&mut self, longest: Duration) -> Option<Pose>;

    /// Whether there will be no more.
    fn is_over(&self) -> bool;

    /// Where it is told how much later than due its poses are displayed.
    fn display_lag(&self) -> DisplayLag {
        DisplayLag::default()
    }

    /// Whether the person is drawn at the moment.
    fn visibility(&self) -> Visibility {
        Visibility::default()
    }
}

/// A pose with its kinematics, on its way to the deform graph.
#[derive(Debug, Clone)]
pub(super) struct Posed {
    pub(super) pose: Pose,
    pub(super) skinning: SkinningTransforms,
}

impl Posed {
    /// Before the first pose.
    pub(super) fn none() -> Self {
        Self {
            pose: Pose {
                motion: MotionParams::default(),
                times: FrameTimes::new(ConcealmentState::Resting, Instant::now()),
            },
            skinning: SkinningTransforms::default(),
        }
    }
}

/// The lane's thread until `stop`, or until the source is over; then it gives the source back.
pub(super) fn run<S: MotionSource>(
    mut source: S,
    skeleton: &Skeleton,
    mut posed: Writer<Posed>,
    mut recorder: Recorder,
    stop: &AtomicBool,
    over: &AtomicBool,
) -> S {
    let mut number = 0;
    while !stop.load(Relaxed) {
        let Some(pose) = source.next(PATIENCE) else {
            if source.is_over() {
                break;
            }
            continue;
        };
        let begun = Instant::now();
        number += 1;
        let place = posed.place();
        skeleton.skinning(&skeleton.pose(&pose.motion), &mut place.skinning);
        place.pose = pose;
        place.pose.times.number = number;
        recorder.span_until_now(Stage::Kinematics, number, begun);
        posed.give();
    }
    over.store(true, Relaxed);
    source
}
