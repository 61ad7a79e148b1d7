//! The `compact` codec's prediction of the next frame from frames that both sides have. Integer arithmetic only.
//!
//! The values of a group move on by a share of their last change, the share that fits the changes before best. The error that this rule
//! would have made for the newest reference frames is the expected size of the residuals now.

use crate::decode_error::DecodeError;
use crate::grid::{GROUPS, Grid, MAX_STEPS, VALUES};
use crate::residual::{Coder, SPREAD_ONE};

/// Frames that both sides have.
#[derive(Clone, Copy)]
pub(crate) struct ReferenceFrames<'a> {
    /// The newest.
    pub(crate) newest: &'a Grid,
    /// Frames from the newest to the one that is predicted.
    pub(crate) ahead: u8,
    /// Three older ones, each `spacing` frames before the next.
    pub(crate) older: Option<([&'a Grid; 3], u8)>,
}

/// Expected size of a residual without any reference, with only the newest reference frame (for each frame since), and the least.
/// Chosen, as the other constants here, for the fewest bits on recorded walks and punches and on the built-in performance.
const SPREAD_UNKNOWN: u32 = 40 * SPREAD_ONE;
const SPREAD_PER_FRAME: u32 = 3 * SPREAD_ONE;
const SPREAD_LEAST: u32 = 5;

/// A share of one, in fixed point.
const WHOLE: i64 = 256;

struct Prediction {
    values: [i64; VALUES],
    /// Expected size of the residuals of each group.
    spread: [u32; GROUPS.len()],
}

fn predict(references: Option<ReferenceFrames<'_>>) -> Prediction {
    let mut out = Prediction {
        values: [0; VALUES],
        spread: [SPREAD_UNKNOWN; GROUPS.len()],
    };
    let Some(references) = references else {
        return out;
    };
    for (out, value) in out.values.iter_mut().zip(references.newest) {
        *out = i64::from(*value);
    }
    let Some(([b, c, d], spacing)) = references.older else {
        out.spread = [SPREAD_PER_FRAME * u32::from(references.ahead); GROUPS.len()];
        return out;
    };
    let a = references.newest;
    for ((first, len), spread) in GROUPS.into_iter().zip(&mut out.spread) {
        let (mut carried, mut size) = (0, 0);
        for i in first..first + len {
            let [last, before, first] = changes([a, b, c, d], i);
            carried += last * before + before * first;
            size += before * before + first * first;
        }
        let share = (WHOLE * carried / (size + 1)).clamp(0, WHOLE);
        let mut error = 0;
        for i in first..first + len {
            let [last, before, first] = changes([a, b, c, d], i);
            error += (WHOLE * last - share * before).abs();
            error += (WHOLE * before - share * first).abs();
            let step = WHOLE * i64::from(spacing);
            out.values[i] +=
                (share * last * i64::from(references.ahead) + step / 2).div_euclid(step);
        }
        let error = error * i64::from(SPREAD_ONE) / (2 * WHOLE * len as i64);
        *spread = u32::try_from(error).unwrap_or(u32::MAX).min(1 << 20);
    }
    out
}

/// The three changes from one reference frame to the next, the last first.
fn changes([a, b, c, d]: [&Grid; 4], i: usize) -> [i64; 3] {
    let at = |grid: &Grid| i64::from(grid[i]);
    [at(a) - at(b), at(b) - at(c), at(c) - at(d)]
}

/// Writes or reads `grid` value by value. The residuals so far correct the size that is expected of the next.
pub(crate) fn code_values(
    coder: &mut impl Coder,
    references: Option<ReferenceFrames<'_>>,
    grid: &mut Grid,
) -> Result<(), DecodeError> {
    let prediction = predict(references);
    // Decaying sums over the values before: of the residuals' sizes and of the expected sizes.
    let (mut actual, mut expected) = (4 * SPREAD_ONE, 4 * SPREAD_ONE);
    for ((first, len), base) in GROUPS.into_iter().zip(prediction.spread) {
        let base = base + SPREAD_LEAST;
        let (mut here, mut count) = (0, 0);
        let group = prediction.values.into_iter().zip(grid.iter_mut());
        for (value, coded) in group.skip(first).take(len) {
            let adapted = u64::from(base) * u64::from(actual) / u64::from(expected);
            let adapted = u32::try_from(adapted).unwrap_or(u32::MAX).clamp(1, 1 << 15);
            let spread = (4 * adapted + here) / (4 + count);
            let value = value.clamp(-i64::from(MAX_STEPS), i64::from(MAX_STEPS));
            let value = i32::try_from(value).unwrap_or(0);
            let residual = coder.residual(spread.max(1), coded.wrapping_sub(value))?;
            *coded = value.saturating_add(residual);
            if coded.abs() > MAX_STEPS {
                return Err(DecodeError::Corrupt);
            }
            let size = residual.unsigned_abs().min(1 << 12) * SPREAD_ONE;
            here += size;
            count += 1;
            actual = actual - actual / 32 + size.min(8 * base) + 1;
            expected = expected - expected / 32 + base + 1;
        }
    }
    Ok(())
}
