//! A few poses and expressions that together stretch a person's surface about as far as it goes.

use super::Person;
use glam::Vec3;
use spmm3::{Joint, MotionParams};

/// Rotations (degrees about x, y, z) of left joints; the right ones mirror them.
type Turns = &'static [(&'static str, [f32; 3])];

const POSES: [Turns; 6] = [
    T_POSE,
    ARMS_DOWN,
    ARMS_UP,
    &[("elbow", [0.0, -110.0, 0.0])],
    &[("hip", [-70.0, 0.0, 0.0]), ("knee", [80.0, 0.0, 0.0])],
    &[
        ("index1", [0.0, 0.0, -70.0]),
        ("index2", [0.0, 0.0, -70.0]),
        ("index3", [0.0, 0.0, -50.0]),
        ("middle1", [0.0, 0.0, -70.0]),
        ("middle2", [0.0, 0.0, -70.0]),
        ("middle3", [0.0, 0.0, -50.0]),
        ("ring1", [0.0, 0.0, -70.0]),
        ("ring2", [0.0, 0.0, -70.0]),
        ("ring3", [0.0, 0.0, -50.0]),
        ("pinky1", [0.0, 0.0, -70.0]),
        ("pinky2", [0.0, 0.0, -70.0]),
        ("pinky3", [0.0, 0.0, -50.0]),
        ("thumb1", [15.0, -15.0, -15.0]),
        ("thumb2", [20.0, -20.0, -20.0]),
        ("thumb3", [20.0, -20.0, -20.0]),
    ],
];

const ARMS_UP: Turns = &[("collar", [0.0, 0.0, 15.0]), ("shoulder", [0.0, 0.0, 50.0])];

/// Halfway down, where most motion happens around.
const RELAXED: Turns = &[("shoulder", [0.0, 0.0, -45.0])];

const T_POSE: Turns = &[];

const ARMS_DOWN: Turns = &[("shoulder", [0.0, 0.0, -70.0])];

fn motion(turns: Turns) -> MotionParams {
    let mut motion = MotionParams::default();
    for joint in Joint::ALL {
        for (name, degrees) in turns {
            let angles = Vec3::from_array(*degrees) * 1f32.to_radians();
            if joint.name().strip_prefix("left_") == Some(name) {
                motion.set_axis_angle(joint, angles);
            } else if joint.name().strip_prefix("right_") == Some(name) {
                motion.set_axis_angle(joint, angles * Vec3::new(1.0, -1.0, -1.0));
            }
        }
    }
    motion
}

/// The mesh with hanging, spread and raised arms: the visible surface differs most between them.
pub(super) fn arms_down_and_up(person: &Person) -> [Vec<Vec3>; 3] {
    [ARMS_DOWN, T_POSE, ARMS_UP].map(|turns| person.posed(&motion(turns)))
}

/// The mesh with relaxed arms.
pub(super) fn relaxed_arms(person: &Person) -> Vec<Vec3> {
    person.posed(&motion(RELAXED))
}

/// The mesh `[N_v]` in every pose and expression of the range.
pub(super) fn range_of_motion(person: &Person) -> Vec<Vec<Vec3>> {
    let poses = POSES.iter().map(|turns| motion(turns));
    // With relaxed arms, as the surface is cut: only the face is to differ.
    let faces = person.presets().values().map(|preset| {
        let mut motion = motion(RELAXED);
        motion
            .expression_mut()
            .copy_from_slice(&preset.coefficients);
        motion.set_axis_angle(Joint::Jaw, Vec3::X * preset.jaw);
        motion
    });
    poses.chain(faces).map(|m| person.posed(&m)).collect()
}
