//! Bounds of a person's motion: finite, near the origin, at most an hour long. Frames are checked
//! before anything is computed from them, and again afterwards.

use super::MotionError;
use crate::{Joint, MotionParams};
use std::ops::RangeInclusive;

/// How far from the origin a root may be along an axis, metres: single precision still resolves a millimetre there.
const MAX_TRANSLATION: f32 = 1e4;
/// Largest expression coefficient: fits have up to ten.
const MAX_EXPRESSION: f32 = 1e3;

/// Longest axis-angle vector along an axis, radians: captures that count whole turns stay far below.
const MAX_TURN: f32 = 1e3;

/// Seconds from frame to frame of anything that moves: the fastest cameras to the slowest slide show.
const FRAME_SECONDS: RangeInclusive<f64> = 1e-3..=1.0;
/// Seconds of the longest clip.
const MAX_SECONDS: f64 = 3600.0;

/// What is wrong with a file's frame time, if something is; a single frame is a pose, whose time does not matter.
pub(super) fn time_fault(frame_seconds: f64, frames: usize) -> Option<String> {
    let moves = frames > 1;
    let possible = if moves {
        FRAME_SECONDS.contains(&frame_seconds)
    } else {
        frame_seconds > 0.0 && frame_seconds <= MAX_SECONDS
    };
    if !possible {
        return Some(format!(
            "a frame time of {frame_seconds} s makes no clip: {} s to {} s from frame to frame are possible",
            FRAME_SECONDS.start(),
            FRAME_SECONDS.end()
        ));
    }
    let seconds = frame_seconds * frames as f64;
    (seconds > MAX_SECONDS).then(|| {
        format!(
            "{frames} frames of {frame_seconds} s are {:.1} hours, and one is the longest: correct the frame time or cut the clip",
            seconds / 3600.0
        )
    })
}

/// Refuses frames that hold numbers out of these bounds.
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

/// Refuses an axis-angle vector as it stands in a file.
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
    // The comparison is false for NaN.
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
