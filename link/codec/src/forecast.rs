//! What the `compact` codec expects of the next frame, from frames that both sides have. Integer arithmetic only.
//!
//! Values that move together carry on with the share of their last change that they carried on with before; by how much that
//! rule would have missed the newest known frame tells by how much it may miss now.

use super::Refusal;
use super::grid::{FURTHEST, GROUPS, Grid, VALUES};
use super::residual::{Coder, SPREAD_ONE};

/// Frames that both sides have.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    /// The newest.
    pub(super) newest: &'a Grid,
    /// Frames from the newest to the one to tell.
    pub(super) ahead: u8,
    /// Three older ones, each `spacing` frames before the next.
    pub(super) older: Option<([&'a Grid; 3], u8)>,
}

/// Spread of a value of which nothing is known, of one of which only the last is known, and what any may be off besides.
/// Chosen, as the other constants here, for the fewest bits on recorded walks and punches and on the built-in performance.
const SPREAD_UNKNOWN: u32 = 40 * SPREAD_ONE;
const SPREAD_PER_FRAME: u32 = 3 * SPREAD_ONE;
const SPREAD_LEAST: u32 = 5;

/// A share of one, in fixed point.
const WHOLE: i64 = 256;

struct Forecast {
    values: [i64; VALUES],
    /// Expected size of the miss of each group.
    spread: [u32; GROUPS.len()],
}

fn forecast(known: Option<Known<'_>>) -> Forecast {
    let mut out = Forecast {
        values: [0; VALUES],
        spread: [SPREAD_UNKNOWN; GROUPS.len()],
    };
    let Some(known) = known else { return out };
    for (out, value) in out.values.iter_mut().zip(known.newest) {
        *out = i64::from(*value);
    }
    let Some(([b, c, d], spacing)) = known.older else {
        out.spread = [SPREAD_PER_FRAME * u32::from(known.ahead); GROUPS.len()];
        return out;
    };
    let a = known.newest;
    for ((first, len), spread) in GROUPS.into_iter().zip(&mut out.spread) {
        let (mut carried, mut size) = (0, 0);
        for i in first..first + len {
            let [last, before, first] = changes([a, b, c, d], i);
            carried += last * before + before * first;
            size += before * before + first * first;
        }
        let share = (WHOLE * carried / (size + 1)).clamp(0, WHOLE);
        let mut missed = 0;
        for i in first..first + len {
            let [last, before, first] = changes([a, b, c, d], i);
            missed += (WHOLE * last - share * before).abs();
            missed += (WHOLE * before - share * first).abs();
            let step = WHOLE * i64::from(spacing);
            out.values[i] += (share * last * i64::from(known.ahead) + step / 2).div_euclid(step);
        }
        let missed = missed * i64::from(SPREAD_ONE) / (2 * WHOLE * len as i64);
        *spread = u32::try_from(missed).unwrap_or(u32::MAX).min(1 << 20);
    }
    out
}

/// The three changes from one known frame to the next, the last first.
fn changes([a, b, c, d]: [&Grid; 4], i: usize) -> [i64; 3] {
    let at = |grid: &Grid| i64::from(grid[i]);
    [at(a) - at(b), at(b) - at(c), at(c) - at(d)]
}

/// Tells `grid`, or is told it, value by value. How far the values before have missed corrects what is expected of the next.
pub(super) fn tell(
    coder: &mut impl Coder,
    known: Option<Known<'_>>,
    grid: &mut Grid,
) -> Result<(), Refusal> {
    let forecast = forecast(known);
    // Decaying sums over the values before, of what they missed by and of what was expected.
    let (mut missed, mut expected) = (4 * SPREAD_ONE, 4 * SPREAD_ONE);
    for ((first, len), base) in GROUPS.into_iter().zip(forecast.spread) {
        let base = base + SPREAD_LEAST;
        let (mut here, mut count) = (0, 0);
        let group = forecast.values.into_iter().zip(grid.iter_mut());
        for (value, told) in group.skip(first).take(len) {
            let adapted = u64::from(base) * u64::from(missed) / u64::from(expected);
            let adapted = u32::try_from(adapted).unwrap_or(u32::MAX).clamp(1, 1 << 15);
            let spread = (4 * adapted + here) / (4 + count);
            let value = value.clamp(-i64::from(FURTHEST), i64::from(FURTHEST));
            let value = i32::try_from(value).unwrap_or(0);
            let miss = coder.miss(spread.max(1), told.wrapping_sub(value))?;
            *told = value.saturating_add(miss);
            if told.abs() > FURTHEST {
                return Err(Refusal::Corrupt);
            }
            let size = miss.unsigned_abs().min(1 << 12) * SPREAD_ONE;
            here += size;
            count += 1;
            missed = missed - missed / 32 + size.min(8 * base) + 1;
            expected = expected - expected / 32 + base + 1;
        }
    }
    Ok(())
}
