//! A person in a call, and the place of a camera that keeps to them.

use app::Call;
use glam::{Quat, Vec3};
use spmm3::{Avatar, Joint, MotionParams};
use std::time::Instant;

/// Share of the way to the person that the camera makes up in a second: it must not sway with every step.
const FOLLOW: f32 = 3.8;

/// A call, seen from where its person stands.
#[derive(Debug)]
pub(crate) struct Live {
    pub(crate) call: Call,
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

impl Live {
    pub(crate) fn new(call: Call, avatar: &Avatar) -> Self {
        Self {
            call,
            pelvis: avatar.skeleton.rest_positions()[Joint::Pelvis.index()],
            followed: None,
        }
    }

    /// What to show now; `None` until the first frame.
    pub(crate) fn now(&mut self) -> Option<Moment> {
        let (motion, _) = self.call.motion()?;
        let now = Instant::now();
        let stands = Vec3::new(1.0, 0.0, 1.0) * (motion.root_translation + self.pelvis);
        let followed = self.followed.get_or_insert_with(|| {
            let forward = motion.rotation(Joint::Pelvis) * Vec3::Z;
            Followed {
                floor: stands,
                heading: Quat::from_rotation_y(forward.x.atan2(forward.z)),
                at: now,
            }
        });
        let elapsed = now.duration_since(followed.at).as_secs_f32();
        followed.floor += (stands - followed.floor) * (1.0 - (-FOLLOW * elapsed).exp());
        followed.at = now;
        Some(Moment {
            motion,
            floor: followed.floor,
            heading: followed.heading,
        })
    }
}
