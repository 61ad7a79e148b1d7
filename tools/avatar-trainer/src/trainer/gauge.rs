//! What all frames' corrections have in common, taken out of them.
//!
//! If a limb of the template turns one way and every frame's pose the other, no picture tells. Poses to come have no correction, so what all frames
//! have in common is the avatar's to learn. Such a turn is one in the joint's own frame, and such a shift one in the pelvis'.

use super::optimiser::FramePose;
use avatar_gradient::{CORRECTION, PoseCorrection};
use glam::{DMat3, DVec3};
use spmm3::{Joint, MotionParams};

/// Frames whose axis-angle vector is so near a whole turn that a turn in the joint's frame is no small change of it are taken as they are.
const LEAST_DETERMINANT: f64 = 0.05;

/// Takes the mean turn of every joint and the mean shift of the pelvis over `frames`, each in its own frame, from each of their corrections.
pub(super) fn centre(poses: &mut [FramePose], motions: &[MotionParams], frames: &[usize]) {
    let Ok(count) = u32::try_from(frames.len().max(1)) else {
        return;
    };
    let share = 1.0 / f64::from(count);
    for part in Joint::ALL.map(Some).into_iter().chain([None]) {
        let at = part.map_or(CORRECTION - 3, MotionParams::offset_of);
        let each = || frames.iter().filter_map(|f| Some((*f, motions.get(*f)?)));
        let mut mean = DVec3::ZERO;
        for (frame, motion) in each() {
            if let Some(pose) = poses.get(frame) {
                mean += share * (own_frame(part, motion) * vector(&pose.correction, at));
            }
        }
        for (frame, motion) in each() {
            if let Some(pose) = poses.get_mut(frame) {
                let less = own_frame(part, motion).inverse() * mean;
                let numbers = &mut pose.correction.0[at..at + 3];
                for (number, less) in numbers.iter_mut().zip(less.as_vec3().to_array()) {
                    *number -= less;
                }
            }
        }
    }
}

fn vector(correction: &PoseCorrection, at: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|axis| f64::from(correction.0[at + axis])))
}

/// Takes a small change of a joint's axis-angle vector to the turn that it is in the joint's frame; without a joint, a shift to the pelvis' frame.
fn own_frame(joint: Option<Joint>, motion: &MotionParams) -> DMat3 {
    let Some(joint) = joint else {
        return DMat3::from_quat(motion.rotation(Joint::Pelvis).as_dquat().normalize()).transpose();
    };
    let r = motion.axis_angle(joint).as_dvec3();
    let angle = r.length();
    if angle < 1e-4 {
        return DMat3::IDENTITY;
    }
    // The right Jacobian of SO(3): exp(r + d) = exp(r) exp(J d) to first order (Sola et al., "A micro Lie theory", 2018).
    let cross = DMat3::from_cols(r.cross(DVec3::X), r.cross(DVec3::Y), r.cross(DVec3::Z));
    let square = angle * angle;
    let jacobian = DMat3::IDENTITY - cross * ((1.0 - angle.cos()) / square)
        + cross * cross * ((angle - angle.sin()) / (square * angle));
    if jacobian.determinant() < LEAST_DETERMINANT {
        DMat3::IDENTITY
    } else {
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3};
    use synthetic_person::Random;

    /// Motions that turn far, the body as well, and the same with every joint turned and the pelvis shifted alike in its own frame.
    fn motions() -> (Vec<MotionParams>, Vec<MotionParams>) {
        let mut random = Random::new(5);
        let captured: Vec<MotionParams> = (0..6).map(|_| random.motion(1.2)).collect();
        let turns: Vec<Vec3> = Joint::ALL.map(|_| 2e-3 * random.vector()).into();
        let shift = Vec3::new(0.004, -0.002, 0.007);
        let alike = captured.iter().map(|motion| {
            let mut moved = motion.clone();
            for (joint, turn) in Joint::ALL.into_iter().zip(&turns) {
                let turned = motion.rotation(joint) * Quat::from_scaled_axis(*turn);
                let at = MotionParams::offset_of(joint);
                moved.values_mut()[at..at + 3].copy_from_slice(&turned.to_scaled_axis().to_array());
            }
            moved.root_translation += motion.rotation(Joint::Pelvis) * shift;
            moved
        });
        let alike = alike.collect();
        (captured, alike)
    }

    fn largest(poses: &[FramePose]) -> f32 {
        let numbers = poses.iter().flat_map(|pose| pose.correction.0);
        numbers.fold(0.0, |most, number| most.max(number.abs()))
    }

    #[test]
    fn what_all_frames_do_alike_in_joints_own_frames_is_taken_out() {
        let (captured, alike) = motions();
        let mut poses: Vec<FramePose> = (captured.iter().zip(&alike))
            .map(|(captured, alike)| FramePose {
                correction: PoseCorrection::between(captured, alike),
                ..FramePose::default()
            })
            .collect();
        assert!(largest(&poses) > 1e-3, "something to take out");
        centre(&mut poses, &captured, &[0, 1, 2, 3, 4, 5]);
        let left = largest(&poses);
        assert!(left < 5e-5, "{left} is left");
    }

    #[test]
    fn one_frames_own_correction_stays_and_other_frames_are_left_alone() {
        let (captured, _) = motions();
        let mut poses = vec![FramePose::default(); captured.len()];
        let knee = MotionParams::offset_of(Joint::LeftKnee);
        poses[1].correction.0[knee] = 0.05;
        poses[5].correction.0[knee] = 0.3;
        centre(&mut poses, &captured, &[0, 1, 2, 3, 4]);
        let at = |frame: usize| poses[frame].correction.0[knee];
        assert!((at(1) - 0.04).abs() < 0.01, "its own: {}", at(1));
        assert!((at(5) - 0.3).abs() < 1e-7, "a frame that is held out");
    }
}
