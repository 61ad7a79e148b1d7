//! What a motion frame may hold, for both codecs and both directions: the sender corrects what lies outside, the viewer refuses it.

use crate::decode_error::DecodeError;
use glam::Vec3;
use spmm3::{Joint, MotionParams};
use std::f32::consts::{PI, TAU};

/// The root translation's furthest coordinate, metres.
pub const MAX_TRANSLATION: f32 = 1000.0;
/// Expression coefficients are at most this far from zero: their range is 16 units. FLAME's are unit normal, and the
/// strongest preset in use is 3.2.
pub const MAX_EXPRESSION: f32 = 8.0;
/// By how much rounding may take the shortest axis-angle vector beyond a half turn, radians.
const ROUNDING: f32 = 0.01;
/// A longer axis-angle vector than this is no measured rotation: two full turns, radians.
const MAX_INPUT_ANGLE: f32 = 2.0 * TAU;
/// Up to this angle the longer of a rotation's two axis-angle vectors is used where it continues the motion, radians.
pub(crate) const MAX_ALIAS_ANGLE: f32 = 1.25 * PI;

/// The shortest axis-angle vector of the rotation, for vectors of at most two full turns.
pub(crate) fn shortest(axis_angle: Vec3) -> Vec3 {
    let angle = axis_angle.length();
    if angle <= PI {
        return axis_angle;
    }
    let turned = angle - TAU * (angle / TAU).round();
    axis_angle * (turned / angle)
}

/// `shortest` or the vector that reaches the same rotation the other way round, whichever continues `near`.
pub(crate) fn nearest_alias(shortest: Vec3, near: Vec3) -> Vec3 {
    let angle = shortest.length();
    if angle < TAU - MAX_ALIAS_ANGLE {
        return shortest;
    }
    let other = shortest * ((angle - TAU) / angle);
    if other.distance_squared(near) < shortest.distance_squared(near) {
        other
    } else {
        shortest
    }
}

/// Brings a tracker's output within the limits: rotations to their shortest vector, numbers into their range, NaN to rest. Also
/// returns how many values changed in meaning.
pub(crate) fn correct(motion: &MotionParams) -> (MotionParams, u64) {
    let mut corrected = motion.clone();
    let mut changed = 0;
    for joint in Joint::ALL {
        let given = motion.axis_angle(joint);
        let usable = given.is_finite() && given.length() <= MAX_INPUT_ANGLE;
        changed += u64::from(!usable);
        corrected.set_axis_angle(joint, if usable { shortest(given) } else { Vec3::ZERO });
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
    for value in corrected.expression_mut() {
        clamp(value, MAX_EXPRESSION);
    }
    for value in corrected.root_translation.as_mut() {
        clamp(value, MAX_TRANSLATION);
    }
    (corrected, changed)
}

/// Refuses a motion outside the limits, which no encoder of this crate writes.
pub(crate) fn check(motion: &MotionParams) -> Result<(), DecodeError> {
    if !motion.is_finite() {
        return Err(DecodeError::NotFinite);
    }
    if Joint::ALL
        .into_iter()
        .any(|joint| motion.axis_angle(joint).length() > PI + ROUNDING)
    {
        return Err(DecodeError::AngleRange);
    }
    if motion
        .expression()
        .iter()
        .any(|value| value.abs() > MAX_EXPRESSION)
    {
        return Err(DecodeError::ExpressionRange);
    }
    if motion.root_translation.abs().max_element() > MAX_TRANSLATION {
        return Err(DecodeError::TranslationRange);
    }
    Ok(())
}
