//! Motion as a sender would send it, without the network: the same 30 times a second for every taker.

use app_pipeline::concealment::ConcealmentState;
use app_pipeline::lanes::{MotionSource, Pose};
use app_pipeline::profile::FrameTimes;
use mon3tr::performance::MOTION_RATE;
use spmm3::MotionParams;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A motion's frames, round and round.
#[derive(Debug)]
pub(super) struct Clip {
    frames: Arc<[MotionParams]>,
    start: Instant,
    sent: u32,
}

impl Clip {
    /// From its first frame, which is due now.
    pub(super) fn new(frames: &Arc<[MotionParams]>) -> Self {
        Self {
            frames: Arc::clone(frames),
            start: Instant::now(),
            sent: 0,
        }
    }
}

impl MotionSource for Clip {
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        let due = self.start + Duration::from_secs_f64(f64::from(self.sent) / MOTION_RATE);
        let wait = due.saturating_duration_since(Instant::now());
        std::thread::sleep(wait.min(longest));
        if wait > longest {
            return None;
        }
        let at = self.sent as usize % self.frames.len().max(1);
        let motion = self.frames.get(at)?.clone();
        self.sent += 1;
        Some(Pose {
            motion,
            times: FrameTimes {
                captured: Some(due),
                released: Instant::now(),
                ..FrameTimes::new(ConcealmentState::Live, due)
            },
        })
    }

    fn is_over(&self) -> bool {
        self.frames.is_empty()
    }
}
