//! A source of poses that a pause holds back.

use super::{MotionSource, Pose, Visibility};
use crate::control::Control;
use crate::timeline::DisplayLag;
use std::time::Duration;

/// A source whose poses are dropped during a pause: they are taken, since the call goes on, and neither NPU nor CPU works in the
/// background.
#[derive(Debug)]
pub struct PausableSource<S> {
    source: S,
    control: Control,
}

impl<S> PausableSource<S> {
    /// `source`, for as long as `control` does not pause.
    pub fn new(source: S, control: Control) -> Self {
        Self { source, control }
    }

    /// The source.
    pub fn source(&self) -> &S {
        &self.source
    }

    /// The source, back.
    pub fn into_source(self) -> S {
        self.source
    }
}

impl<S: MotionSource> MotionSource for PausableSource<S> {
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        self.source
            .next(longest)
            .filter(|_| !self.control.is_paused())
    }

    fn is_over(&self) -> bool {
        self.source.is_over()
    }

    fn display_lag(&self) -> DisplayLag {
        self.source.display_lag()
    }

    fn visibility(&self) -> Visibility {
        self.source.visibility()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::concealment::ConcealmentState;
    use crate::profile::FrameTimes;
    use spmm3::MotionParams;
    use std::time::Instant;

    #[test]
    fn poses_of_a_pause_are_taken_and_dropped() {
        struct Steady(u32);
        impl MotionSource for Steady {
            fn next(&mut self, _: Duration) -> Option<Pose> {
                self.0 += 1;
                Some(Pose {
                    motion: MotionParams::default(),
                    times: FrameTimes::new(ConcealmentState::Live, Instant::now()),
                })
            }

            fn is_over(&self) -> bool {
                self.0 >= 4
            }
        }
        let control = Control::default();
        let mut source = PausableSource::new(Steady(0), control.clone());
        assert!(source.next(Duration::ZERO).is_some(), "shown");
        assert!(control.pause(Duration::from_secs(2)), "nobody is at work");
        assert!(source.next(Duration::ZERO).is_none(), "dropped");
        assert!(source.next(Duration::ZERO).is_none(), "dropped, too");
        control.resume();
        assert!(source.next(Duration::ZERO).is_some(), "shown again");
        assert!(source.is_over(), "all four were taken from the source");
        assert_eq!(source.into_source().0, 4, "each once");
    }
}
