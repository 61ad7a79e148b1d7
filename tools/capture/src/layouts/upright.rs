//! Worlds whose up is another axis than y, turned so that it is y.

use super::found::Found;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use spmm3::Joint;

/// The axes that may be up, their names, and what turns each to y.
fn axes() -> [(DVec3, &'static str, DMat3); 6] {
    let about_x = DMat3::from_cols;
    [
        (DVec3::Y, "y up", DMat3::IDENTITY),
        (
            DVec3::NEG_Y,
            "y down",
            DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
        ),
        (DVec3::Z, "z up", about_x(DVec3::X, DVec3::NEG_Z, DVec3::Y)),
        (
            DVec3::NEG_Z,
            "z down",
            about_x(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        ),
        (DVec3::X, "x up", about_x(DVec3::Y, DVec3::NEG_X, DVec3::Z)),
        (
            DVec3::NEG_X,
            "x down",
            about_x(DVec3::NEG_Y, DVec3::X, DVec3::Z),
        ),
    ]
}

/// Turns cameras and poses so that the world's up is y. Which axis it was is told by where the bodies' heads are over their hips, or without poses by
/// the cameras, which stand upright on average.
pub(super) fn turn_up(found: &mut Found) {
    let (mean, by) = match &found.poses {
        Some(poses) => {
            let up = |k: usize| poses[k].parameters.rotation(Joint::Pelvis).as_dquat() * DVec3::Y;
            let sum: DVec3 = (0..poses.len())
                .step_by((poses.len() / 200).max(1))
                .map(up)
                .sum();
            (sum, "the bodies")
        }
        None => {
            let up = found.cameras.iter();
            let sum: DVec3 = up
                .map(|camera| -camera.camera_from_world.matrix3.row(1))
                .sum();
            (sum, "the cameras")
        }
    };
    let best = axes()
        .into_iter()
        .max_by(|a, b| a.0.dot(mean).total_cmp(&b.0.dot(mean)));
    let Some((_, name, turn)) = best.filter(|_| mean.is_finite()) else {
        return;
    };
    found
        .notes
        .push(format!("the data's axes, by {by}: {name}"));
    if turn == DMat3::IDENTITY {
        return;
    }
    let back = DAffine3::from_mat3(turn.transpose());
    for camera in &mut found.cameras {
        camera.camera_from_world *= back;
    }
    let quarter = DQuat::from_mat3(&turn);
    for pose in found.poses.iter_mut().flatten() {
        let root = pose.parameters.rotation(Joint::Pelvis).as_dquat();
        let turned = (quarter * root).normalize().as_quat();
        pose.parameters.set_rotation(Joint::Pelvis, turned);
        pose.pelvis = (quarter * pose.pelvis.as_dvec3()).as_vec3();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_turn_is_a_rotation_that_brings_its_axis_to_y() {
        for (axis, name, turn) in axes() {
            assert_eq!(turn * axis, DVec3::Y, "{name}");
            assert_eq!(turn.determinant(), 1.0, "{name}");
        }
    }
}
