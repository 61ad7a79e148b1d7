//! One frame of a body in the room, and how it is known.

use super::super::chain::BODY_JOINTS;
use super::super::reading::Exchange;
use super::super::triangulate::{Located, LocatedBody, pixel};
use crate::landmarks::{BODY_LANDMARKS, BodyLandmarks};
use glam::{Quat, Vec3};
use spmm3::{Joint, MotionParams};

/// Two cameras agree on a landmark that is located with this confidence: surely seen, it is a standard deviation and a half off in each.
const AGREEING: f64 = 0.3;
/// A camera that sees fewer landmarks sees no body.
const LEAST_SEEN: usize = 6;

/// How the pose of a frame is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sight {
    /// Two cameras at least agree where more than half of the landmarks are: their rays tell the depth.
    Agreed,
    /// Cameras saw a body, but no two of them agree. The pose follows from those of the frames beside it, or where no two cameras ever agree, from
    /// the skeleton's size in one picture: what is across that picture is known, the depth is a guess.
    Doubtful,
    /// No camera saw a body: the pose is between those before and after, or is held where there is but one of them.
    Unseen,
}

impl Sight {
    /// Of what cameras saw in a frame, and the landmarks that were located by it.
    pub(super) fn of(seen: &[Option<BodyLandmarks>], located: &LocatedBody) -> Self {
        let agreed = |located: &&Located| located.confidence >= AGREEING;
        if located.iter().flatten().filter(agreed).count() > BODY_LANDMARKS / 2 {
            return Self::Agreed;
        }
        let body = |seen: &BodyLandmarks| {
            let sure = |k: &usize| pixel(Some(seen), *k, Exchange::NONE).1 > 0.0;
            (0..BODY_LANDMARKS).filter(sure).count() >= LEAST_SEEN
        };
        if seen.iter().flatten().any(body) {
            Self::Doubtful
        } else {
            Self::Unseen
        }
    }
}

/// One frame of a body in the room.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomPose {
    /// The pelvis joint in the world, metres.
    pub pelvis: Vec3,
    /// Of each body joint relative to its parent, the pelvis relative to the world.
    pub rotations: [Quat; BODY_JOINTS],
    /// How far it is to be believed.
    pub sight: Sight,
    /// Root mean square distance of each camera's landmarks from the pose, pixels; `None` where it saw no body.
    pub reprojection_px: Vec<Option<f64>>,
    /// The cameras in which the network had left and right exchanged, at least in a half of the body.
    pub exchanged: Vec<bool>,
}

impl RoomPose {
    /// Writes the body's joints into `motion`; face, fingers and root stay.
    pub fn write(&self, motion: &mut MotionParams) {
        for (joint, rotation) in Joint::ALL.into_iter().zip(self.rotations) {
            motion.set_rotation(joint, rotation);
        }
    }
}
