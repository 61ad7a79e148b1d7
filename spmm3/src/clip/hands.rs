//! Hands: which joints are fingers, which way a palm faces, and the pose of a relaxed hand.

use crate::{Joint, MotionParams, Skeleton};
use glam::{Mat3, Vec3};

/// Curl of each finger joint, radians, where the file has no fingers: a relaxed hand.
const RELAXED_CURL: f32 = 0.30;

/// Fingers of a hand as (first joint, second, third), left then right.
pub(super) const FINGERS: [[Joint; 3]; 10] = {
    use Joint::*;
    [
        [LeftIndex1, LeftIndex2, LeftIndex3],
        [LeftMiddle1, LeftMiddle2, LeftMiddle3],
        [LeftPinky1, LeftPinky2, LeftPinky3],
        [LeftRing1, LeftRing2, LeftRing3],
        [LeftThumb1, LeftThumb2, LeftThumb3],
        [RightIndex1, RightIndex2, RightIndex3],
        [RightMiddle1, RightMiddle2, RightMiddle3],
        [RightPinky1, RightPinky2, RightPinky3],
        [RightRing1, RightRing2, RightRing3],
        [RightThumb1, RightThumb2, RightThumb3],
    ]
};

/// Columns: along, across (made square to it), and their normal.
pub(super) fn frame(along: Vec3, across: Vec3) -> Option<Mat3> {
    let along = along.try_normalize()?;
    let across = across.reject_from_normalized(along).try_normalize()?;
    Some(Mat3::from_cols(along, across, along.cross(across)))
}

/// Our palm in T-pose: from the wrist to the knuckles, and from the little finger to the index.
pub(super) fn palm(skeleton: &Skeleton, side: usize) -> Option<Mat3> {
    let at = |finger: usize| skeleton.rest_positions()[FINGERS[side * 5 + finger][0].index()];
    let wrist = [Joint::LeftWrist, Joint::RightWrist][side];
    let knuckles = (at(0) + at(1) + at(2) + at(3)) * 0.25;
    frame(
        knuckles - skeleton.rest_positions()[wrist.index()],
        at(0) - at(2),
    )
}

/// Axis about which the fingers of a hand curl into the palm, for positive angles, in T-pose.
pub(super) fn curl_axis(skeleton: &Skeleton, side: usize) -> Vec3 {
    let across = palm(skeleton, side).map_or(Vec3::Z, |palm| palm.y_axis);
    if side == 0 { -across } else { across }
}

pub(super) fn relax(motion: &mut MotionParams, skeleton: &Skeleton, side: usize) {
    let axis = curl_axis(skeleton, side);
    for finger in &FINGERS[side * 5..side * 5 + 4] {
        for joint in finger {
            motion.set_axis_angle(*joint, axis * RELAXED_CURL);
        }
    }
}
