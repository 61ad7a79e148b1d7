//! What a fit tells: the pose, how sure it is, and where the camera is.

use super::chain::BODY_JOINTS;
use crate::landmarks::blazepose::{ANKLES, EARS, ELBOWS, HIPS, KNEES, NOSE, SHOULDERS, WRISTS};
use glam::{Mat3, Quat, Vec3};
use spmm3::{Joint, MotionParams};

/// Parts of the body that have a confidence of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub enum Limb {
    /// Pelvis, spine and collars.
    Torso,
    /// Neck and head.
    Head,
    /// Left shoulder to wrist.
    LeftArm,
    /// Right shoulder to wrist.
    RightArm,
    /// Left hip to foot.
    LeftLeg,
    /// Right hip to foot.
    RightLeg,
}

impl Limb {
    /// All limbs, in the order of [`BodyPose::confidence`].
    pub const ALL: [Self; 6] = [
        Self::Torso,
        Self::Head,
        Self::LeftArm,
        Self::RightArm,
        Self::LeftLeg,
        Self::RightLeg,
    ];

    /// The limb that a joint belongs to; fingers to their arm, jaw and eyes to the head.
    #[must_use]
    pub fn of(joint: Joint) -> Self {
        let name = joint.name();
        let left = name.starts_with("left");
        if name.contains("eye") || matches!(joint, Joint::Neck | Joint::Head | Joint::Jaw) {
            Self::Head
        } else if ["hip", "knee", "ankle", "foot"]
            .iter()
            .any(|n| name.ends_with(n))
        {
            if left { Self::LeftLeg } else { Self::RightLeg }
        } else if matches!(joint, Joint::LeftCollar | Joint::RightCollar)
            || name.starts_with("spine")
            || joint == Joint::Pelvis
        {
            Self::Torso
        } else if left {
            Self::LeftArm
        } else {
            Self::RightArm
        }
    }

    pub(super) fn landmarks(self) -> [usize; 4] {
        match self {
            Self::Torso => [SHOULDERS[0], SHOULDERS[1], HIPS[0], HIPS[1]],
            Self::Head => [NOSE, NOSE, EARS[0], EARS[1]],
            Self::LeftArm => [ELBOWS[0], ELBOWS[0], WRISTS[0], WRISTS[0]],
            Self::RightArm => [ELBOWS[1], ELBOWS[1], WRISTS[1], WRISTS[1]],
            Self::LeftLeg => [KNEES[0], KNEES[0], ANKLES[0], ANKLES[0]],
            Self::RightLeg => [KNEES[1], KNEES[1], ANKLES[1], ANKLES[1]],
        }
    }
}

/// Where the camera is, as far as the pictures tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraPose {
    /// How far it looks down, radians.
    pub pitch_radians: f32,
    /// Its height above the floor in metres of the avatar's size.
    pub height_metres: f32,
    /// Rotation from the avatar's world (y up) to camera axes (y down, z away).
    pub camera_from_world: Mat3,
    /// The camera in the avatar's world, metres.
    pub position: Vec3,
}

/// A fitted pose, in the conventions of [`MotionParams`]: y up, metres, the floor at y = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyPose {
    /// As [`MotionParams::root_translation`]. The first seen place is above the origin.
    pub root_translation: Vec3,
    /// Of each body joint relative to its parent, the pelvis relative to the world.
    pub rotations: [Quat; BODY_JOINTS],
    /// 0..=1 of each limb, in the order of [`Limb::ALL`]: how sure its landmarks were.
    pub confidence: [f32; 6],
    /// Root mean square distance of the landmarks from the fitted pose in the picture, pixels.
    pub reprojection_px: f32,
    /// Whether left and right had been mistaken, at least in one half of the body.
    pub swapped: bool,
    /// The camera's pose that was used.
    pub camera: CameraPose,
    /// Whether heel and ball of the left and of the right foot stand on the floor: for [`super::FootLock`].
    pub standing: [[bool; 2]; 2],
    /// Whether a body was seen; otherwise the pose coasts to rest.
    pub seen: bool,
}

impl BodyPose {
    /// Writes the body's joints and the root into `motion`; face and fingers stay.
    pub fn write(&self, motion: &mut MotionParams) {
        for (joint, rotation) in Joint::ALL.into_iter().zip(self.rotations) {
            motion.set_rotation(joint, rotation);
        }
        motion.root_translation = self.root_translation;
    }
}
