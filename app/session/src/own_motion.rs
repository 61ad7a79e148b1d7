//! The motion of the person who looks, for a look at themselves: the newest, and nothing while they do not look.

use app_pipeline::concealment::ConcealmentState;
use app_pipeline::lanes::{MotionSource, Pose, Visibility};
use app_pipeline::profile::FrameTimes;
use spmm3::MotionParams;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Hands one's own motion to a session that shows it. Copies hand it to the same one. It is not shown at first.
#[derive(Debug, Clone)]
pub struct OwnMotion(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    newest: Mutex<Option<(MotionParams, Instant)>>,
    changed: Condvar,
    visibility: Visibility,
}

impl Default for OwnMotion {
    fn default() -> Self {
        let visibility = Visibility::default();
        visibility.hide(true);
        Self(Arc::new(Shared {
            newest: Mutex::default(),
            changed: Condvar::new(),
            visibility,
        }))
    }
}

impl OwnMotion {
    /// Shows this motion, captured at `captured`, instead of any before.
    pub fn show(&self, captured: Instant, motion: &MotionParams) {
        if !self.0.visibility.is_hidden() {
            *self.lock() = Some((motion.clone(), captured));
            self.0.changed.notify_all();
        }
    }

    /// Has oneself be seen, or not any longer; whether one is seen from now on.
    pub fn toggle(&self) -> bool {
        let is_seen = self.0.visibility.is_hidden();
        self.0.visibility.hide(!is_seen);
        is_seen
    }

    /// Whether one is seen.
    #[must_use]
    pub fn is_seen(&self) -> bool {
        !self.0.visibility.is_hidden()
    }

    fn lock(&self) -> MutexGuard<'_, Option<(MotionParams, Instant)>> {
        self.0.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl MotionSource for OwnMotion {
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        let waited =
            (self.0.changed).wait_timeout_while(self.lock(), longest, |newest| newest.is_none());
        let (mut newest, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let (motion, captured) = newest.take()?;
        Some(Pose {
            motion,
            times: FrameTimes::new(ConcealmentState::Live, captured),
        })
    }

    fn is_over(&self) -> bool {
        false
    }

    fn visibility(&self) -> Visibility {
        self.0.visibility.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn only_the_newest_motion_is_shown_and_none_while_nobody_looks() {
        let mut own = OwnMotion::default();
        let at = |x: f32| {
            let mut motion = MotionParams::default();
            motion.root_translation = Vec3::X * x;
            motion
        };
        own.show(Instant::now(), &at(1.0));
        assert!(own.next(Duration::ZERO).is_none(), "not looked at");
        let hidden = own.visibility();
        assert!(hidden.is_hidden());
        assert!(own.toggle() && own.is_seen(), "seen from now on");
        own.show(Instant::now(), &at(2.0));
        own.show(Instant::now(), &at(3.0));
        let shown = own.next(Duration::ZERO).expect("the newest");
        assert_eq!(shown.motion.root_translation.x, 3.0);
        assert!(own.next(Duration::ZERO).is_none(), "once");
        assert!(!own.toggle() && hidden.is_hidden(), "no longer");
    }
}
