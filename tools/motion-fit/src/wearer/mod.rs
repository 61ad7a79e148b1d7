//! The wearer of a headset: head and hands as `OpenXR` gives them become the motion of an avatar.
//!
//! A headset may track more: its body's joints bend the torso, arms and legs where they are sure, and its face and gaze are the avatar's.
//!
//! The skeleton is bent by the solver that cameras use: eyes and wrists are where they were measured, soles stand on the floor, and the
//! rest is what recorded people do. No time passes between a sample and its motion: nothing is smoothed, for headsets smooth what they track.
//!
//! *Floor space* is the headset's: metres, y up, the floor at y = 0, a view looks along -z. *Motion space* is the avatar's: metres, y up,
//! the floor at y = 0, and the person faces +z where the wearer began.

mod body;
mod expression;
mod facing;
mod feet;
mod fit;
mod hands;
mod sample;
mod space;

pub use expression::{
    ARKIT_OF_HEADSET, FACE_EXPRESSION_NAMES, LEAST_GAZE_CONFIDENCE, WearerExpression,
};
pub use fit::{Stance, WearerFit, WearerMotion};
pub use sample::{
    FACE_EXPRESSIONS, HAND_JOINTS, HandJoints, WEARER_JOINTS, WearerBody, WearerFace, WearerGaze,
    WearerHand, WearerJoint, WearerSample,
};

use glam::{DQuat, DVec3};

/// A rigid pose: `space_from_thing`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pose {
    rotation: DQuat,
    /// Metres.
    position: DVec3,
}

/// What is ahead of a person who is turned by `yaw` radians about y from +z.
fn ahead(yaw: f64) -> DVec3 {
    DVec3::new(yaw.sin(), 0.0, yaw.cos())
}

/// `angle` plus whole turns, within half a turn of zero.
fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle + PI).rem_euclid(TAU) - PI
}
