//! The integer grid of the `compact` codec: the step of each motion value, quantisation and its inverse.
//!
//! A rotation's error moves the whole limb below the joint, so a joint's step is the finer the longer its limb.
//! The pelvis alone turns all the way round: it is kept as a quaternion, which has no jump at the half turn.

use crate::decode_error::DecodeError;
use crate::limits;
use glam::{Quat, Vec3, Vec4};
use spmm3::{EXPRESSION, JOINTS, Joint, MotionParams};

/// Values of a frame: the pelvis' quaternion, the root translation, 54 axis-angle vectors, 50 coefficients.
pub(crate) const VALUES: usize = JOINTS_AT + 3 * (JOINTS - 1) + EXPRESSION;
const TRANSLATION_AT: usize = 4;
const JOINTS_AT: usize = 7;
const EXPRESSION_AT: usize = JOINTS_AT + 3 * (JOINTS - 1);

/// One frame on the grid.
pub(crate) type Grid = [i32; VALUES];

/// No value of a frame within the limits lies further out.
pub(crate) const MAX_STEPS: i32 = 1 << 22;

/// Values that move together, and are predicted together: (first, how many).
pub(crate) const GROUPS: [(usize, usize); JOINTS + 1 + EXPRESSION / EXPRESSION_GROUP] = groups();
const EXPRESSION_GROUP: usize = 10;

const fn groups() -> [(usize, usize); JOINTS + 1 + EXPRESSION / EXPRESSION_GROUP] {
    let mut groups = [(0, TRANSLATION_AT); JOINTS + 1 + EXPRESSION / EXPRESSION_GROUP];
    let mut group = 1;
    let mut first = TRANSLATION_AT;
    while group < groups.len() {
        let len = if first < EXPRESSION_AT {
            3
        } else {
            EXPRESSION_GROUP
        };
        groups[group] = (first, len);
        first += len;
        group += 1;
    }
    groups
}

/// Grid steps in a metre, and in a unit of expression.
const PER_METRE: f32 = 2048.0;
const PER_COEFFICIENT: f32 = 32.0;
/// A joint's step is a whole number of these parts of a radian.
const PARTS: f32 = 4096.0;

/// The step of `joint`, radians: about 0.8 mm at the end of its limb, and small enough to keep the rotation
/// within half a degree (the error is at most sqrt(3)/2 steps).
pub(crate) fn step(joint: Joint) -> f32 {
    use Joint::*;
    let parts: u8 = match joint {
        Pelvis | LeftHip | RightHip | Spine1 => 3,
        Spine2 | Spine3 | LeftCollar | RightCollar => 4,
        LeftShoulder | RightShoulder => 5,
        LeftKnee | RightKnee | LeftElbow | RightElbow => 7,
        Neck => 10,
        Head | LeftWrist | RightWrist | LeftAnkle | RightAnkle | LeftEye | RightEye => 16,
        Jaw => 24,
        LeftIndex1 | LeftMiddle1 | LeftPinky1 | LeftRing1 | LeftThumb1 | RightIndex1
        | RightMiddle1 | RightPinky1 | RightRing1 | RightThumb1 => 32,
        _ => 40,
    };
    f32::from(parts) / PARTS
}

/// Puts a frame within the limits on the grid. Of the two quaternions and the two axis-angle vectors of one rotation it takes
/// the one that continues `near`, so that a rotation past the half turn stays cheap.
pub(crate) fn quantise(motion: &MotionParams, near: Option<&Grid>) -> Grid {
    let mut grid = [0; VALUES];
    let root = Vec4::from(motion.rotation(Joint::Pelvis));
    let before = near.map_or(Vec4::W, |near| {
        Vec4::from_array([
            near[0] as f32,
            near[1] as f32,
            near[2] as f32,
            near[3] as f32,
        ])
    });
    let root = if root.dot(before) < 0.0 { -root } else { root };
    put(
        &mut grid[..TRANSLATION_AT],
        &root.to_array(),
        quaternion_step(),
    );
    put(
        &mut grid[TRANSLATION_AT..JOINTS_AT],
        &motion.root_translation.to_array(),
        PER_METRE.recip(),
    );
    for (joint, at) in jointed() {
        let shortest = motion.axis_angle(joint);
        let step = step(joint);
        let near = near.map_or(Vec3::ZERO, |near| vector(near, at) * step);
        let chosen = limits::nearest_alias(shortest, near);
        put(&mut grid[at..at + 3], &chosen.to_array(), step);
    }
    put(
        &mut grid[EXPRESSION_AT..],
        motion.expression(),
        PER_COEFFICIENT.recip(),
    );
    grid
}

/// The motion of a frame on the grid.
///
/// # Errors
/// If the pelvis' quaternion is not of unit length, or a value lies outside the limits.
pub(crate) fn restore(grid: &Grid) -> Result<MotionParams, DecodeError> {
    let mut motion = MotionParams::default();
    let step_root = quaternion_step();
    let root = Vec4::new(
        grid[0] as f32,
        grid[1] as f32,
        grid[2] as f32,
        grid[3] as f32,
    ) * step_root;
    // Each component may be half a step off.
    if (root.length() - 1.0).abs() > 2.0 * step_root {
        return Err(DecodeError::AngleRange);
    }
    motion.set_rotation(Joint::Pelvis, Quat::from_vec4(root.normalize()));
    motion.root_translation = vector(grid, TRANSLATION_AT) / PER_METRE;
    for (joint, at) in jointed() {
        let stored = vector(grid, at) * step(joint);
        if stored.length() > limits::MAX_ALIAS_ANGLE + 0.02 {
            return Err(DecodeError::AngleRange);
        }
        motion.set_axis_angle(joint, limits::shortest(stored));
    }
    for (value, stored) in motion
        .expression_mut()
        .iter_mut()
        .zip(&grid[EXPRESSION_AT..])
    {
        *value = *stored as f32 / PER_COEFFICIENT;
    }
    limits::check(&motion)?;
    Ok(motion)
}

/// All joints but the pelvis, with where their vectors begin.
fn jointed() -> impl Iterator<Item = (Joint, usize)> {
    Joint::ALL.into_iter().skip(1).zip((JOINTS_AT..).step_by(3))
}

/// A unit quaternion turns twice as fast as it moves.
fn quaternion_step() -> f32 {
    step(Joint::Pelvis) / 2.0
}

fn vector(grid: &Grid, at: usize) -> Vec3 {
    Vec3::new(grid[at] as f32, grid[at + 1] as f32, grid[at + 2] as f32)
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "values within the limits are far below 2^24 steps"
)]
fn put(out: &mut [i32], values: &[f32], step: f32) {
    for (out, value) in out.iter_mut().zip(values) {
        *out = (value / step).round() as i32;
    }
}
