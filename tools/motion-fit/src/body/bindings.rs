//! Where on the skeleton each landmark sits, and how far it is trusted there.

use super::{
    chain::{Attachment, wide},
    reading::{ANKLES, EARS, ELBOWS, HEELS, HIPS, KNEES, NOSE, SHOULDERS, TOES, WRISTS},
};
use nalgebra::Vector3;
use spmm3::{Joint, Skeleton};

/// A landmark on the skeleton.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Binding {
    /// Index in BlazePose's order.
    pub(super) landmark: usize,
    pub(super) at: Attachment,
    /// Weight of its place in metres; 1 for a joint of a limb.
    pub(super) solid: f64,
    /// Weight of its pixel. Shoulders and hips have little: the network's points are not the skeleton's joints, and a difference of two
    /// centimetres across the hips would turn the pelvis.
    pub(super) pixel: f64,
}

/// Landmarks that a body is fitted to.
pub(super) const COUNT: usize = 25;

/// The network's hips are this much wider apart than the hip joints.
const HIP_WIDTH: f64 = 1.25;

/// Puts the landmarks on `skeleton`.
pub(super) fn bind(skeleton: &Skeleton) -> [Binding; COUNT] {
    let rest = |joint: Joint| wide(skeleton.rest_positions()[joint.index()]);
    let between = |from: Joint, to: Joint| rest(to) - rest(from);
    let binding = |landmark, joint, offset, solid, pixel| Binding {
        landmark,
        at: Attachment::new(joint, offset),
        solid,
        pixel,
    };
    let none = Vector3::zeros();
    use Joint::*;
    let hip = |joint| between(Pelvis, joint).component_mul(&Vector3::new(HIP_WIDTH, 1.0, 1.0));
    let side = |sign: f64, x: f64, y: f64, z: f64| Vector3::new(sign * x, y, z);
    let heel = |ankle: Joint| Vector3::new(0.0, 0.5 * (-rest(ankle).y).clamp(-0.2, 0.0), -0.05);
    let toe = |ankle, foot, sign| between(ankle, foot) + side(sign, -0.016, -0.008, 0.05);
    let index = |wrist, finger| between(wrist, finger);
    [
        binding(NOSE, Head, Vector3::new(0.0, 0.03, 0.12), 0.5, 0.5),
        binding(2, Head, side(1.0, 0.03, 0.065, 0.09), 0.5, 0.5),
        binding(5, Head, side(-1.0, 0.03, 0.065, 0.09), 0.5, 0.5),
        binding(EARS[0], Head, side(1.0, 0.075, 0.05, 0.01), 0.5, 0.5),
        binding(EARS[1], Head, side(-1.0, 0.075, 0.05, 0.01), 0.5, 0.5),
        binding(SHOULDERS[0], LeftShoulder, none, 1.0, 0.25),
        binding(SHOULDERS[1], RightShoulder, none, 1.0, 0.25),
        binding(ELBOWS[0], LeftElbow, none, 1.0, 1.0),
        binding(ELBOWS[1], RightElbow, none, 1.0, 1.0),
        binding(WRISTS[0], LeftWrist, none, 1.0, 1.0),
        binding(WRISTS[1], RightWrist, none, 1.0, 1.0),
        binding(17, LeftWrist, index(LeftWrist, LeftPinky1), 0.5, 0.4),
        binding(18, RightWrist, index(RightWrist, RightPinky1), 0.5, 0.4),
        binding(19, LeftWrist, index(LeftWrist, LeftIndex1), 0.5, 0.4),
        binding(20, RightWrist, index(RightWrist, RightIndex1), 0.5, 0.4),
        binding(HIPS[0], Pelvis, hip(LeftHip), 1.0, 0.25),
        binding(HIPS[1], Pelvis, hip(RightHip), 1.0, 0.25),
        binding(KNEES[0], LeftKnee, none, 1.0, 1.0),
        binding(KNEES[1], RightKnee, none, 1.0, 1.0),
        binding(ANKLES[0], LeftAnkle, none, 1.0, 1.0),
        binding(ANKLES[1], RightAnkle, none, 1.0, 1.0),
        binding(HEELS[0], LeftAnkle, heel(LeftAnkle), 0.5, 0.5),
        binding(HEELS[1], RightAnkle, heel(RightAnkle), 0.5, 0.5),
        binding(TOES[0], LeftAnkle, toe(LeftAnkle, LeftFoot, 1.0), 0.5, 0.5),
        binding(
            TOES[1],
            RightAnkle,
            toe(RightAnkle, RightFoot, -1.0),
            0.5,
            0.5,
        ),
    ]
}
