//! What a motion frame may hold, for both codecs and both directions: the sender mends what lies outside, the viewer refuses it.

use super::Refusal;
use glam::Vec3;
use spmm3::{Joint, MotionParams};
use std::f32::consts::{PI, TAU};

/// The root translation's furthest coordinate, metres.
pub const MAX_TRANSLATION: f32 = 1000.0;
/// Expression coefficients are at most this far from zero: their range is 16 units. FLAME's are unit normal, and the
/// strongest preset in use is 3.2.
pub const MAX_EXPRESSION: f32 = 8.0;
/// What the shortest axis-angle vector may exceed a half turn by for having been rounded, radians.
const ROUNDING: f32 = 0.01;
/// A longer vector than this is no rotation that anybody measured: two full turns, radians.
const LONGEST_INPUT: f32 = 2.0 * TAU;
/// Up to this angle the longer of a rotation's two axis-angle vectors is used where it continues the motion, radians.
pub(super) const LONGEST_ALIAS: f32 = 1.25 * PI;

/// The shortest axis-angle vector of the rotation, for vectors of at most two full turns.
pub(super) fn shortest(axis_angle: Vec3) -> Vec3 {
    let angle = axis_angle.length();
    if angle <= PI {
        return axis_angle;
    }
    let turned = angle - TAU * (angle / TAU).round();
    axis_angle * (turned / angle)
}

/// `shortest` or the vector that reaches the same rotation the other way round, whichever continues `near`.
pub(super) fn nearest_alias(shortest: Vec3, near: Vec3) -> Vec3 {
    let angle = shortest.length();
    if angle < TAU - LONGEST_ALIAS {
        return shortest;
    }
    let other = shortest * ((angle - TAU) / angle);
    if other.distance_squared(near) < shortest.distance_squared(near) {
        other
    } else {
        shortest
    }
}

/// Brings what a tracker says within the limits: rotations to their shortest vector, numbers into their range, anything
/// that is no number to rest. Also how many values had to be changed in meaning.
pub(super) fn mend(motion: &MotionParams) -> (MotionParams, u64) {
    let mut mended = motion.clone();
    let mut changed = 0;
    for joint in Joint::ALL {
        let given = motion.axis_angle(joint);
        let usable = given.is_finite() && given.length() <= LONGEST_INPUT;
        changed += u64::from(!usable);
        mended.set_axis_angle(joint, if usable { shortest(given) } else { Vec3::ZERO });
    }
    let mut clamp = |value: &mut f32, most: f32| {
        let within = if value.is_nan() {
            0.0
        } else {
            value.clamp(-most, most)
        };
        changed += u64::from(within != *value);
        *value = within;
    };
    for value in mended.expression_mut() {
        clamp(value, MAX_EXPRESSION);
    }
    for value in mended.root_translation.as_mut() {
        clamp(value, MAX_TRANSLATION);
    }
    (mended, changed)
}

/// Refuses what no honest sender sends.
pub(super) fn check(motion: &MotionParams) -> Result<(), Refusal> {
    if !motion.is_finite() {
        return Err(Refusal::NotFinite);
    }
    if Joint::ALL
        .into_iter()
        .any(|joint| motion.axis_angle(joint).length() > PI + ROUNDING)
    {
        return Err(Refusal::AngleRange);
    }
    if motion
        .expression()
        .iter()
        .any(|value| value.abs() > MAX_EXPRESSION)
    {
        return Err(Refusal::ExpressionRange);
    }
    if motion.root_translation.abs().max_element() > MAX_TRANSLATION {
        return Err(Refusal::TranslationRange);
    }
    Ok(())
}
