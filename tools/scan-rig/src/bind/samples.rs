//! Poses in which every Gaussian has to stay with its body.

use glam::Vec3;
use spmm3::{Joint, MotionParams};
use std::f32::consts::FRAC_PI_2;

/// The T-pose, arms raised, arms at the body, a punch, a step with each foot, hands before the chest, a crouch. Rotations are relative to the T-pose, the person faces +z.
pub(super) fn samples() -> Vec<MotionParams> {
    let turns: [&[(Joint, Vec3)]; 8] = [
        &[],
        &[
            (Joint::LeftCollar, Vec3::Z * 0.25),
            (Joint::LeftShoulder, Vec3::Z * 0.95),
            (Joint::RightCollar, Vec3::Z * -0.25),
            (Joint::RightShoulder, Vec3::Z * -0.95),
        ],
        &[
            (Joint::LeftShoulder, Vec3::Z * -1.2),
            (Joint::RightShoulder, Vec3::Z * 1.2),
        ],
        &[
            (Joint::Spine2, Vec3::Y * 0.35),
            (Joint::LeftShoulder, Vec3::Y * -FRAC_PI_2),
            (Joint::RightShoulder, Vec3::Z * 1.0),
            (Joint::RightElbow, Vec3::Y * 1.9),
        ],
        &[
            (Joint::LeftHip, Vec3::X * -0.6),
            (Joint::LeftKnee, Vec3::X * 0.2),
            (Joint::RightHip, Vec3::X * 0.4),
            (Joint::RightKnee, Vec3::X * 0.5),
            (Joint::LeftShoulder, Vec3::Z * -1.1),
            (Joint::RightShoulder, Vec3::new(-0.5, 0.0, 1.1)),
        ],
        &[
            (Joint::RightHip, Vec3::X * -0.6),
            (Joint::RightKnee, Vec3::X * 0.2),
            (Joint::LeftHip, Vec3::X * 0.4),
            (Joint::LeftKnee, Vec3::X * 0.5),
            (Joint::RightShoulder, Vec3::Z * 1.1),
            (Joint::LeftShoulder, Vec3::new(-0.5, 0.0, -1.1)),
        ],
        &[
            (Joint::LeftShoulder, Vec3::new(0.0, -0.4, -1.1)),
            (Joint::LeftElbow, Vec3::Y * -1.9),
            (Joint::RightShoulder, Vec3::new(0.0, 0.4, 1.1)),
            (Joint::RightElbow, Vec3::Y * 1.9),
            (Joint::Head, Vec3::Y * 0.6),
        ],
        &[
            (Joint::LeftHip, Vec3::new(-1.2, 0.0, 0.2)),
            (Joint::LeftKnee, Vec3::X * 1.4),
            (Joint::RightHip, Vec3::new(-1.2, 0.0, -0.2)),
            (Joint::RightKnee, Vec3::X * 1.4),
            (Joint::LeftShoulder, Vec3::Y * -1.2),
            (Joint::RightShoulder, Vec3::Y * 1.2),
        ],
    ];
    turns
        .iter()
        .map(|turns| {
            let mut motion = MotionParams::default();
            for (joint, turn) in *turns {
                motion.set_axis_angle(*joint, *turn);
            }
            motion
        })
        .collect()
}
