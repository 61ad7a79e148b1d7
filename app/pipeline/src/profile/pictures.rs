//! What the display showed: pictures in time and late, the same Gaussians again, blanks missed, and the quality held.

use super::recorded::nanoseconds;
use crate::profile::{PictureTimes, Recording};
use serde::Serialize;
use std::time::Duration;

/// A share of the Gaussians by which two pictures must differ for it to be another quality.
const ANOTHER_COUNT: f64 = 0.02;

/// What became of pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PictureFigures {
    /// Pictures shown.
    pub shown: usize,
    /// Shown each second, from the first to the last.
    pub per_second: f64,
    /// Of them with Gaussians of their own.
    pub fresh_per_second: f64,
    /// With the Gaussians of the one before, because the CPU lane was not there in time.
    pub repeated: usize,
    /// Shown after the vertical blank they were meant for.
    pub late: usize,
    /// Vertical blanks between pictures that had none.
    pub missed_vblanks: u64,
    /// How good pictures were, from each change on.
    pub quality: Vec<Quality>,
}

/// How good pictures are from some time on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quality {
    /// Since the measuring began.
    pub at_s: f64,
    /// Part of the full width and height that is drawn.
    pub scale: f32,
    /// Gaussians drawn.
    pub gaussians: u32,
}

impl PictureFigures {
    /// Of a display that shows a picture every `period`.
    #[must_use]
    pub fn new(recording: &Recording, period: Duration) -> Self {
        let pictures = &recording.pictures;
        let shown_at = |k: usize| pictures.get(k).map(|one| one.displayed);
        let first_to_last = shown_at(0)
            .zip(pictures.last())
            .map_or(0.0, |(first, last)| (last.displayed - first).as_secs_f64());
        let per_second = |count: usize| match count {
            2.. if first_to_last > 0.0 => (count - 1) as f64 / first_to_last,
            _ => 0.0,
        };
        let repeated = pictures.iter().filter(|one| one.repeated).count();
        let missed = pictures.windows(2).map(|two| match two {
            [one, next] => blanks_between((next.displayed - one.displayed).as_secs_f64(), period),
            _ => 0,
        });
        Self {
            shown: pictures.len(),
            per_second: per_second(pictures.len()),
            fresh_per_second: per_second(pictures.len() - repeated),
            repeated,
            late: pictures
                .iter()
                .filter(|one| Self::is_late(one, period))
                .count(),
            missed_vblanks: missed.sum(),
            quality: quality(recording),
        }
    }

    /// Whether `one` was shown after the vertical blank it was meant for.
    pub fn is_late(one: &PictureTimes, period: Duration) -> bool {
        nanoseconds(one.predicted, one.displayed) as f64 / 1e9 > 0.5 * period.as_secs_f64()
    }
}

/// Vertical blanks that lie between two that are so many `seconds` apart.
fn blanks_between(seconds: f64, period: Duration) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small count; casting saturates"
    )]
    let periods = (seconds / period.as_secs_f64().max(1e-6)).round() as u64;
    periods.saturating_sub(1)
}

fn quality(recording: &Recording) -> Vec<Quality> {
    let mut changes: Vec<Quality> = Vec::new();
    for one in &recording.pictures {
        let is_same = changes.last().is_some_and(|last| {
            let apart = f64::from(last.gaussians.abs_diff(one.gaussians));
            last.scale.total_cmp(&one.scale).is_eq()
                && apart <= ANOTHER_COUNT * f64::from(last.gaussians)
        });
        if !is_same {
            changes.push(Quality {
                at_s: (one.displayed - recording.begin).as_secs_f64(),
                scale: one.scale,
                gaussians: one.gaussians,
            });
        }
    }
    changes
}
