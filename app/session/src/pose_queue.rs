//! Poses one at a time, each when it is asked for: for stills, whose display waits for each.

use app_pipeline::concealment::ConcealmentState;
use app_pipeline::lanes::{MotionSource, Pose};
use app_pipeline::profile::FrameTimes;
use spmm3::MotionParams;
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Hands poses to a person. Copies hand them to the same one.
#[derive(Debug, Clone, Default)]
pub struct PoseQueue(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    poses: Mutex<VecDeque<MotionParams>>,
    changed: Condvar,
}

impl PoseQueue {
    /// The person takes this pose after those that were asked for before.
    pub fn push(&self, motion: MotionParams) {
        self.lock().push_back(motion);
        self.0.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<MotionParams>> {
        self.0.poses.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl MotionSource for PoseQueue {
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        let waited =
            (self.0.changed).wait_timeout_while(self.lock(), longest, |poses| poses.is_empty());
        let (mut poses, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let motion = poses.pop_front()?;
        Some(Pose {
            motion,
            times: FrameTimes::new(ConcealmentState::Live, Instant::now()),
        })
    }

    fn is_over(&self) -> bool {
        false
    }
}
