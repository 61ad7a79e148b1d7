//! What a person's motion can be: finite, and somewhere near the origin. Looked at before anything is computed from a
//! clip, and once more afterwards.

use super::MotionError;
use crate::{Joint, MotionParams};

/// How far from the origin a root may be along an axis, metres: single precision still resolves a millimetre there.
const MAX_TRANSLATION: f32 = 1e4;
/// Largest expression coefficient: fits have up to ten.
const MAX_EXPRESSION: f32 = 1e3;

/// Longest axis-angle vector along an axis, radians: captures that count whole turns stay far below.
const MAX_TURN: f32 = 1e3;

/// Refuses frames that hold numbers no person's motion has.
pub(super) fn check(frames: &[MotionParams]) -> Result<(), MotionError> {
    for (at, frame) in frames.iter().enumerate() {
        let place = || "the root's place in metres".to_owned();
        let translation = frame.root_translation.to_array();
        beyond(at, place, &translation, MAX_TRANSLATION)?;
        let coefficient = || "an expression coefficient".to_owned();
        beyond(at, coefficient, frame.expression(), MAX_EXPRESSION)?;
        for joint in Joint::ALL {
            check_turn(at, joint, &frame.axis_angle(joint).to_array())?;
        }
    }
    Ok(())
}

/// Refuses an axis-angle vector as a file has it.
pub(super) fn check_turn(frame: usize, joint: Joint, turn: &[f32]) -> Result<(), MotionError> {
    beyond(
        frame,
        || format!("{}'s turn in radians", joint.name()),
        turn,
        MAX_TURN,
    )
}

fn beyond(
    frame: usize,
    what: impl FnOnce() -> String,
    values: &[f32],
    limit: f32,
) -> Result<(), MotionError> {
    // NaN is within no limit.
    let within = |value: &f32| value.abs() <= limit;
    match values.iter().find(|value| !within(value)) {
        None => Ok(()),
        Some(value) => Err(MotionError::Range {
            frame,
            what: what(),
            value: *value,
            limit,
        }),
    }
}
