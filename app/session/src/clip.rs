//! A motion clip as a source of poses, without a network: its frames at their rate, each as if it had been captured and had arrived just
//! now.

use app_pipeline::concealment::ConcealmentState;
use app_pipeline::lanes::{MotionSource, Pose};
use app_pipeline::profile::FrameTimes;
use spmm3::MotionParams;
use std::time::{Duration, Instant};

/// A clip that repeats.
#[derive(Debug, Clone)]
pub struct ClipSource {
    frames: Vec<MotionParams>,
    interval: Duration,
    next: usize,
    due: Option<Instant>,
}

impl ClipSource {
    /// Of these frames, `rate_hz` a second, from the first pose that is asked for. Without any frame it is over at once.
    #[must_use]
    pub fn new(frames: Vec<MotionParams>, rate_hz: f64) -> Self {
        Self {
            frames,
            interval: Duration::from_secs_f64(1.0 / rate_hz.clamp(1.0, 1000.0)),
            next: 0,
            due: None,
        }
    }
}

impl MotionSource for ClipSource {
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        let motion = self.frames.get(self.next)?;
        let now = Instant::now();
        let mut due = *self.due.get_or_insert(now);
        let pause = due.saturating_duration_since(now);
        if pause > longest {
            std::thread::sleep(longest);
            return None;
        }
        std::thread::sleep(pause);
        let arrived = Instant::now();
        if arrived.saturating_duration_since(due) > self.interval * 2 {
            // The machine stood still: what was missed is not caught up with.
            due = arrived;
        }
        self.due = Some(due + self.interval);
        self.next = (self.next + 1) % self.frames.len();
        Some(Pose {
            motion: motion.clone(),
            times: FrameTimes {
                captured: Some(due),
                due,
                ..FrameTimes::new(ConcealmentState::Live, arrived)
            },
        })
    }

    fn is_over(&self) -> bool {
        self.frames.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn frames_come_in_order_at_their_rate_and_begin_again() {
        let at = |x| {
            let mut motion = MotionParams::default();
            motion.root_translation = Vec3::X * x;
            motion
        };
        let mut clip = ClipSource::new(vec![at(1.0), at(2.0), at(3.0)], 200.0);
        let poses: Vec<_> = (0..7)
            .map(|_| clip.next(Duration::from_secs(1)).expect("a pose"))
            .collect();
        let seen: Vec<_> = (poses.iter())
            .map(|pose| pose.motion.root_translation.x)
            .collect();
        assert_eq!(seen, [1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0], "over and over");
        for pair in poses.windows(2) {
            assert!(
                pair[1].times.due >= pair[0].times.due + Duration::from_millis(5),
                "never sooner than they should"
            );
        }
        assert!(!clip.is_over(), "no end");
        assert!(ClipSource::new(Vec::new(), 30.0).is_over(), "of nothing");
    }

    #[test]
    fn there_is_no_pose_before_the_next_frame_is_due() {
        let mut clip = ClipSource::new(vec![MotionParams::default()], 1.0);
        assert!(clip.next(Duration::ZERO).is_some(), "the first");
        assert!(clip.next(Duration::from_millis(1)).is_none(), "not yet");
    }
}
