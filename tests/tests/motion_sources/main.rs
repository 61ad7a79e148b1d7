//! Motion sources against independent forward kinematics: real captures, files the tests write, and hostile files.

mod built_in;
mod npz;
mod real_files;
mod reference;
mod small_files;

use glam::Vec3;
use spmm3::Skeleton;

/// Joints of a man of 1.75 m in T-pose, SMPL-X's order, metres; only the left side, the right is its mirror image.
const LEFT_AND_MIDDLE: [(&str, [f32; 3]); 31] = [
    ("pelvis", [0.0, 0.8894, 0.0151]),
    ("left_hip", [0.1026, 0.8811, 0.0067]),
    ("spine1", [0.0, 0.9698, -0.0237]),
    ("left_knee", [0.1161, 0.48, 0.0393]),
    ("spine2", [0.0, 1.0367, -0.008]),
    ("left_ankle", [0.125, 0.0706, 0.0243]),
    ("spine3", [0.0, 1.113, -0.006]),
    ("left_foot", [0.1212, 0.015, 0.1596]),
    ("neck", [0.0, 1.4349, 0.0069]),
    ("left_collar", [0.023, 1.3631, 0.024]),
    ("head", [0.0, 1.546, 0.0102]),
    ("left_shoulder", [0.1775, 1.375, 0.0211]),
    ("left_elbow", [0.4215, 1.3688, 0.0132]),
    ("left_wrist", [0.6585, 1.3758, 0.0199]),
    ("jaw", [0.0, 1.541, 0.0602]),
    ("left_eye_smplhf", [0.0291, 1.5726, 0.121]),
    ("left_index1", [0.7578, 1.3732, 0.0576]),
    ("left_index2", [0.7845, 1.3707, 0.0581]),
    ("left_index3", [0.8084, 1.369, 0.0572]),
    ("left_middle1", [0.7596, 1.371, 0.0335]),
    ("left_middle2", [0.7934, 1.37, 0.0339]),
    ("left_middle3", [0.8197, 1.3673, 0.0357]),
    ("left_pinky1", [0.7485, 1.3702, -0.0055]),
    ("left_pinky2", [0.7714, 1.3696, -0.0046]),
    ("left_pinky3", [0.7864, 1.3696, -0.0041]),
    ("left_ring1", [0.755, 1.3721, 0.0125]),
    ("left_ring2", [0.7849, 1.3709, 0.0127]),
    ("left_ring3", [0.8099, 1.3686, 0.0148]),
    ("left_thumb1", [0.6927, 1.3731, 0.0492]),
    ("left_thumb2", [0.7046, 1.3486, 0.0659]),
    ("left_thumb3", [0.7425, 1.3443, 0.0683]),
];

/// The skeleton that all motion is retargeted onto.
fn man() -> Skeleton {
    let positions = spmm3::Joint::ALL.map(|joint| {
        let name = joint.name();
        let left = name.replace("right", "left");
        let (_, [x, y, z]) = LEFT_AND_MIDDLE
            .into_iter()
            .find(|(known, _)| *known == left)
            .expect("every joint has a position");
        let mirror = if name.starts_with("right") { -1.0 } else { 1.0 };
        Vec3::new(mirror * x, y, z)
    });
    Skeleton::new(positions).expect("a man's joints are in range")
}
