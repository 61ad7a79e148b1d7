//! Feet on the floor: the height of the soles, a clip's height over the floor, and its starting point.
//!
//! It moves whole frames only. It plants no foot by bending a leg: a captured step keeps its small slide.

use crate::{Joint, JointTransforms, MotionParams, Skeleton};
use glam::Vec3;

/// Heel behind the ankle and toe tip before the ball, metres, for a grown person's shoe.
const HEEL: f32 = 0.055;
const TOE: f32 = 0.07;

/// Half a window of time within which a standing or walking person has a sole on the floor, seconds.
const WINDOW: f64 = 0.75;
/// How far the floor may be from the whole clip's, metres.
const DRIFT: f32 = 0.08;

/// How a clip's height over the floor is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Height {
    /// The file moves its root: the floor under it changes slowly, if at all.
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
pub(super) fn stand(
    frames: &mut [MotionParams],
    frame_seconds: f64,
    skeleton: &Skeleton,
    height: Height,
) {
    let lowest: Vec<f32> = frames
        .iter()
        .map(|frame| lowest_sole(skeleton, &skeleton.pose(frame)) + frame.root_translation.y)
        .collect();
    let Some(start) = frames.first().map(|f| f.root_translation) else {
        return;
    };
    let hips = start + skeleton.rest_positions()[Joint::Pelvis.index()];
    let floor = match height {
        Height::Travels => floor_under(&lowest, frame_seconds),
        Height::Unknown => lowest,
    };
    for (frame, floor) in frames.iter_mut().zip(floor) {
        frame.root_translation -= Vec3::new(hips.x, floor, hips.z);
    }
}

/// Height of the floor at each frame: a low percentile of the lowest soles within the window, smoothed.
///
/// It follows a floor that drifts (CMU's rises by 4 cm over a walk of 3 m: a matter of calibration). A step's or a
/// jump's flight is shorter than the window and does not lift it, and it stays within [`DRIFT`] of the whole clip's floor,
/// so that stairs and a sofa keep their height.
fn floor_under(lowest: &[f32], frame_seconds: f64) -> Vec<f32> {
    let whole = percentile(lowest);
    let half = super::floor_index((WINDOW / frame_seconds).clamp(1.0, 1e6));
    // A knot every eighth of the window is enough, whatever the frame rate.
    let step = (half / 8).max(1);
    let knots: Vec<f32> = (0..lowest.len())
        .step_by(step)
        .map(|at| {
            let window = &lowest[at.saturating_sub(half)..lowest.len().min(at + half + 1)];
            // Not `clamp`, which panics where the limits are not numbers.
            percentile(window).max(whole - DRIFT).min(whole + DRIFT)
        })
        .collect();
    let knot = |k: isize| {
        let last = isize::try_from(knots.len()).map_or(0, |n| n - 1);
        usize::try_from(k.min(last).max(0))
            .ok()
            .and_then(|k| knots.get(k).copied())
            .unwrap_or(whole)
    };
    let smooth = |k: isize| {
        let sum: f32 = (-4..=4).map(|d| knot(k + d)).sum();
        sum / 9.0
    };
    (0..lowest.len())
        .map(|at| {
            let k = isize::try_from(at / step).unwrap_or(0);
            let share = (at % step) as f32 / step as f32;
            smooth(k) * (1.0 - share) + smooth(k + 1) * share
        })
        .collect()
}

/// The value that a fifth of the heights lie below: one bad frame does not decide.
fn percentile(heights: &[f32]) -> f32 {
    let mut sorted = heights.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted.get(sorted.len() / 5).copied().unwrap_or_default()
}
