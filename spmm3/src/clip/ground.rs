//! Feet on the floor: where the soles are, how high a clip must stand, and where it begins.
//!
//! It moves whole frames only. It plants no foot by bending a leg: a captured step keeps its small slide.

use crate::{Joint, JointTransforms, MotionParams, Skeleton};
use glam::Vec3;

/// Heel behind the ankle and toe tip before the ball, metres, for a grown person's shoe.
const HEEL: f32 = 0.055;
const TOE: f32 = 0.07;

/// How a clip's height over the floor is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Height {
    /// The file moves its root: one shift for the whole clip.
    Travels,
    /// The file turns joints only: every frame stands on its lowest sole.
    Unknown,
}

/// Points of both soles on the template's floor (y = 0), each with the joint that carries it.
fn soles(skeleton: &Skeleton) -> [(Joint, Vec3); 6] {
    let rest = skeleton.rest_positions();
    let under = |joint: Joint, forward: f32| {
        let at = rest[joint.index()];
        Vec3::new(at.x, 0.0, at.z + forward)
    };
    [
        (Joint::LeftAnkle, under(Joint::LeftAnkle, -HEEL)),
        (Joint::LeftAnkle, under(Joint::LeftFoot, 0.0)),
        (Joint::LeftFoot, under(Joint::LeftFoot, TOE)),
        (Joint::RightAnkle, under(Joint::RightAnkle, -HEEL)),
        (Joint::RightAnkle, under(Joint::RightFoot, 0.0)),
        (Joint::RightFoot, under(Joint::RightFoot, TOE)),
    ]
}

/// Height of the lowest sole of a posed person, root translation left out.
fn lowest_sole(skeleton: &Skeleton, joints: &JointTransforms) -> f32 {
    soles(skeleton)
        .into_iter()
        .map(|(joint, at)| {
            let local = at - skeleton.rest_positions()[joint.index()];
            joints.person_from_joint[joint.index()]
                .transform_point3(local)
                .y
        })
        .fold(f32::INFINITY, f32::min)
}

/// Shifts all frames so that the lowest sole is at y = 0 and the first frame's hips are at x = z = 0.
///
/// The clip's floor is the 20th percentile of the frames' lowest soles: a single bad frame does not lift the person,
/// and neither does a jump.
pub(super) fn stand(frames: &mut [MotionParams], skeleton: &Skeleton, height: Height) {
    let mut lowest: Vec<f32> = frames
        .iter()
        .map(|frame| lowest_sole(skeleton, &skeleton.pose(frame)) + frame.root_translation.y)
        .collect();
    if height == Height::Unknown {
        for (frame, lowest) in frames.iter_mut().zip(&lowest) {
            frame.root_translation.y -= lowest;
        }
        lowest.fill(0.0);
    }
    let mut sorted = lowest;
    sorted.sort_by(f32::total_cmp);
    let floor = sorted.get(sorted.len() / 5).copied().unwrap_or_default();
    let Some(start) = frames.first().map(|f| f.root_translation) else {
        return;
    };
    let hips = start + skeleton.rest_positions()[Joint::Pelvis.index()];
    for frame in frames {
        frame.root_translation -= Vec3::new(hips.x, floor, hips.z);
    }
}
