//! Where on the skeleton each landmark sits, and how far it is trusted there.

use super::chain::{Attachment, wide};
use crate::landmarks::BODY_LANDMARKS;
use crate::landmarks::blazepose::{
    ANKLES, EARS, ELBOWS, HEELS, HIPS, KNEES, NOSE, SHOULDERS, TOES, WRISTS,
};
use nalgebra::Vector3;
use spmm3::{Joint, MotionParams, Skeleton};

/// A landmark on the skeleton.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Binding {
    /// Index in BlazePose's order.
    pub(super) landmark: usize,
    /// Where its place in metres is.
    pub(super) at: Attachment,
    /// Where its pixel is.
    pub(super) drawn: Attachment,
    /// Weight of its place in metres; 1 for a joint of a limb.
    pub(super) solid: f64,
    /// Weight of its pixel.
    pub(super) pixel: f64,
    /// How much further than others' its depth errs.
    pub(super) depth: f64,
}

/// Landmarks that a body is fitted to.
pub(super) const COUNT: usize = 25;

/// Where the network sees hips, as shares of the height of the shoulder joints above the floor: half their width, their height, and how far
/// before the pelvis. Where rigs put hip joints differs by centimetres, so those are not asked. Measured on renders of the demo avatar: in the
/// picture they are on the body's front, where annotators saw them (`HIP_AHEAD`); the network's metres have them within.
const HIP_HALF_WIDTH: f64 = 0.075;
const HIP_HEIGHT: f64 = 0.637;
const HIP_AHEAD: f64 = 0.042;
const HIP_WITHIN: f64 = 0.01;
/// Head, shoulders and hands err along the line of sight this much more than the rest: 100 to 200 mm against 60, and of a body that is
/// seen obliquely the network turns the shoulders by three quarters of their angle.
const EXTREMITY_DEPTH: f64 = 2.0;
/// From the shoulder joint to the network's shoulder on top of it: inwards and up, as shares of half the shoulders' width.
const SHOULDER: [f64; 2] = [0.10, 0.14];
/// How far elbow, wrist and knee are seen beyond their joints, as shares of the bone or hand that follows.
const BEYOND: [f64; 3] = [0.05, 0.13, 0.03];

/// Puts the landmarks on `skeleton`.
pub(super) fn bind(skeleton: &Skeleton) -> [Binding; COUNT] {
    let rest = |joint: Joint| wide(skeleton.rest_positions()[joint.index()]);
    let between = |from: Joint, to: Joint| rest(to) - rest(from);
    let binding = |landmark, joint, offset, solid, pixel| Binding {
        landmark,
        at: Attachment::new(joint, offset),
        drawn: Attachment::new(joint, offset),
        solid,
        pixel,
        depth: if landmark <= SHOULDERS[1] || (WRISTS[0]..HIPS[0]).contains(&landmark) {
            EXTREMITY_DEPTH
        } else {
            1.0
        },
    };
    use Joint::*;
    let side = |sign: f64, x: f64, y: f64, z: f64| Vector3::new(sign * x, y, z);
    let height = (rest(LeftShoulder).y + rest(RightShoulder).y) / 2.0;
    let hips = (rest(LeftHip) + rest(RightHip)) / 2.0;
    let hip = |sign: f64, ahead: f64| {
        let place = Vector3::new(
            hips.x + sign * HIP_HALF_WIDTH * height,
            HIP_HEIGHT * height,
            (hips.z + rest(Pelvis).z) / 2.0 + ahead * height,
        );
        Attachment::new(Pelvis, place - rest(Pelvis))
    };
    let hip_binding = |landmark, sign: f64| Binding {
        landmark,
        at: hip(sign, HIP_WITHIN),
        drawn: hip(sign, HIP_AHEAD),
        solid: 1.0,
        pixel: 1.0,
        depth: 1.0,
    };
    let half = (rest(LeftShoulder).x - rest(RightShoulder).x).abs() / 2.0;
    let shoulder = |collar, shoulder, sign: f64| {
        between(collar, shoulder) + side(sign, -SHOULDER[0] * half, SHOULDER[1] * half, 0.0)
    };
    let elbow = |elbow, wrist| between(elbow, wrist) * BEYOND[0];
    let wrist =
        |wrist, finger| between(wrist, finger).component_mul(&Vector3::new(BEYOND[1], 0.0, 0.0));
    let knee = |knee, ankle| between(knee, ankle) * BEYOND[2];
    let heel = |ankle: Joint| Vector3::new(0.0, 0.75 * (-rest(ankle).y).clamp(-0.2, 0.0), -0.035);
    let toe = |ankle, foot, sign| between(ankle, foot) + side(sign, -0.010, 0.004, 0.037);
    // The sides of the palm, not the knuckles.
    let little =
        |wrist, finger| between(wrist, finger).component_mul(&Vector3::new(0.97, 1.0, 0.35));
    let index = |wrist, finger| {
        between(wrist, finger).component_mul(&Vector3::new(0.84, 1.0, 0.55)) - Vector3::y() * 0.01
    };
    [
        binding(NOSE, Head, Vector3::new(0.0, 0.015, 0.12), 0.5, 0.5),
        binding(2, Head, side(1.0, 0.03, 0.05, 0.093), 0.5, 0.5),
        binding(5, Head, side(-1.0, 0.03, 0.05, 0.093), 0.5, 0.5),
        binding(EARS[0], Head, side(1.0, 0.068, 0.04, 0.02), 0.5, 0.5),
        binding(EARS[1], Head, side(-1.0, 0.068, 0.04, 0.02), 0.5, 0.5),
        binding(
            SHOULDERS[0],
            LeftCollar,
            shoulder(LeftCollar, LeftShoulder, 1.0),
            1.0,
            1.0,
        ),
        binding(
            SHOULDERS[1],
            RightCollar,
            shoulder(RightCollar, RightShoulder, -1.0),
            1.0,
            1.0,
        ),
        binding(ELBOWS[0], LeftElbow, elbow(LeftElbow, LeftWrist), 1.0, 1.0),
        binding(
            ELBOWS[1],
            RightElbow,
            elbow(RightElbow, RightWrist),
            1.0,
            1.0,
        ),
        binding(WRISTS[0], LeftWrist, wrist(LeftWrist, LeftIndex1), 1.0, 1.0),
        binding(
            WRISTS[1],
            RightWrist,
            wrist(RightWrist, RightIndex1),
            1.0,
            1.0,
        ),
        binding(17, LeftWrist, little(LeftWrist, LeftPinky1), 0.5, 0.4),
        binding(18, RightWrist, little(RightWrist, RightPinky1), 0.5, 0.4),
        binding(19, LeftWrist, index(LeftWrist, LeftIndex1), 0.5, 0.4),
        binding(20, RightWrist, index(RightWrist, RightIndex1), 0.5, 0.4),
        hip_binding(HIPS[0], 1.0),
        hip_binding(HIPS[1], -1.0),
        binding(KNEES[0], LeftKnee, knee(LeftKnee, LeftAnkle), 1.0, 1.0),
        binding(KNEES[1], RightKnee, knee(RightKnee, RightAnkle), 1.0, 1.0),
        binding(ANKLES[0], LeftAnkle, Vector3::zeros(), 1.0, 1.0),
        binding(ANKLES[1], RightAnkle, Vector3::zeros(), 1.0, 1.0),
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

/// Where each landmark of a network is expected on a person of `skeleton` in `motion`: in the motion's room, metres; `None` of those that a
/// body is not fitted to. For comparing a fit with landmarks that were seen otherwise, as by several cameras.
#[must_use]
pub fn landmark_places(
    skeleton: &Skeleton,
    motion: &MotionParams,
) -> [Option<glam::Vec3>; BODY_LANDMARKS] {
    let joints = skeleton.pose(motion);
    let mut places = [None; BODY_LANDMARKS];
    for binding in bind(skeleton) {
        let (Some(joint), Some(place)) = (
            Joint::ALL.get(binding.drawn.joint),
            places.get_mut(binding.landmark),
        ) else {
            continue;
        };
        let [x, y, z]: [f64; 3] = binding.drawn.offset.into();
        let offset = glam::DVec3::new(x, y, z).as_vec3();
        let turn = glam::Mat3::from(joints.person_from_joint[joint.index()].matrix3);
        *place = Some(joints.position(*joint) + motion.root_translation + turn * offset);
    }
    places
}
