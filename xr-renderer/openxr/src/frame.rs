//! One frame of a headset: its display time and the poses of the eyes.

use std::time::{Duration, Instant};

use glam::{Affine3A, Quat};
use openxr::{Instance as XrInstance, Time, View};
use renderer_splat::camera::{Camera, Fov};

use crate::pose::rigid;

/// A frame that the runtime wants now.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    pub(crate) time: Time,
    /// When it will be seen, by this machine's clock.
    pub predicted: Instant,
    /// From one frame of the display to the next, as the runtime sees it now: it may change with every frame.
    pub period: Duration,
    /// Whether it will be displayed at all.
    pub should_render: bool,
}

/// Where the eyes are when a frame is displayed.
#[derive(Clone, Copy)]
pub struct Eyes {
    pub(crate) views: [View; 2],
    /// Left and right, in floor space, for pictures of the headset's full size.
    pub cameras: [Camera; 2],
    /// The middle of the head, looking along -z.
    pub floor_from_head: Affine3A,
}

impl std::fmt::Debug for Eyes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Eyes")
            .field("cameras", &self.cameras)
            .finish_non_exhaustive()
    }
}

impl Eyes {
    /// The eyes as the runtime locates them, if the poses are valid.
    pub(crate) fn of(views: &[View], width: u32, height: u32) -> Option<Self> {
        let &[left, right] = views else { return None };
        let camera = |view: View| {
            let Affine3A {
                matrix3,
                translation: position,
            } = rigid(&view.pose)?;
            let fov = Fov {
                left: view.fov.angle_left,
                right: view.fov.angle_right,
                up: view.fov.angle_up,
                down: view.fov.angle_down,
            };
            let open = |from: f32, to: f32| {
                let limits = -1.55..1.55;
                limits.contains(&from) && limits.contains(&to) && from + 0.01 < to
            };
            let sound = open(fov.left, fov.right) && open(fov.down, fov.up);
            sound.then(|| {
                Camera::from_fov(
                    position.into(),
                    Quat::from_mat3a(&matrix3),
                    fov,
                    width,
                    height,
                )
            })
        };
        let cameras = [camera(left)?, camera(right)?];
        let [from_left, from_right] = [rigid(&left.pose)?, rigid(&right.pose)?];
        let mut floor_from_head = from_left;
        floor_from_head.translation = (from_left.translation + from_right.translation) * 0.5;
        Some(Self {
            views: [left, right],
            cameras,
            floor_from_head,
        })
    }
}

/// The runtime's clock by this machine's.
pub(crate) struct XrClock {
    /// Whether the runtime tells its time now (`XR_KHR_convert_timespec_time`).
    converts: bool,
}

impl XrClock {
    pub(crate) fn new(converts: bool) -> Self {
        Self { converts }
    }

    /// When a frame will be seen; without a common clock, one period from now.
    pub(crate) fn instant(&self, instance: &XrInstance, time: Time, period: Duration) -> Instant {
        if let Some((now, present)) = self.both_clocks(instance) {
            let ahead = time.as_nanos().saturating_sub(present.as_nanos());
            let by = Duration::from_nanos(ahead.unsigned_abs().min(10_000_000_000));
            return if ahead >= 0 {
                now + by
            } else {
                now.checked_sub(by).unwrap_or(now)
            };
        }
        Instant::now() + period
    }

    /// This machine's clock and the runtime's at one moment. They are read one after the other; where the thread was interrupted in between,
    /// which would move the frame in time by as much, they are read again.
    pub(crate) fn both_clocks(&self, instance: &XrInstance) -> Option<(Instant, Time)> {
        if !self.converts {
            return None;
        }
        let mut read = None;
        for _ in 0..4 {
            let now = Instant::now();
            read = Some((now, instance.now().ok()?));
            if now.elapsed() < Duration::from_micros(100) {
                break;
            }
        }
        read
    }
}
