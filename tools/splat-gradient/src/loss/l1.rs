//! Mean absolute differences.

use super::Target;
use crate::error::GradientError;
use crate::picture::{CHANNELS, Picture};
use crate::vector::{LANES, add_to, load};
use fearless_simd::{Level, dispatch, f32x8, mask32x8, prelude::*};
use rayon::prelude::*;
use std::ops::Range;

/// The L1 loss of the paper (section IV-C): the mean of |drawn - target| over red, green, blue and the weighted pixels.
///
/// # Errors
/// Pictures of different sizes.
pub fn colour_l1(
    drawn: &Picture,
    target: &Target,
    share: f32,
    by_pixel: &mut Picture,
) -> Result<f64, GradientError> {
    l1(drawn, target, 0..CHANNELS - 1, share, by_pixel)
}

/// The mean of |drawn - target| of alpha over the weighted pixels: the silhouette.
///
/// # Errors
/// Pictures of different sizes.
pub fn alpha_l1(
    drawn: &Picture,
    target: &Target,
    share: f32,
    by_pixel: &mut Picture,
) -> Result<f64, GradientError> {
    l1(drawn, target, CHANNELS - 1..CHANNELS, share, by_pixel)
}

fn l1(
    drawn: &Picture,
    target: &Target,
    channels: Range<usize>,
    share: f32,
    by_pixel: &mut Picture,
) -> Result<f64, GradientError> {
    target.check(drawn, by_pixel)?;
    let (level, width) = (Level::new(), drawn.width().max(1));
    #[expect(clippy::cast_precision_loss, reason = "at most four channels")]
    let mean = target.inverse_sum() / channels.len() as f64;
    #[expect(clippy::cast_possible_truncation, reason = "a factor of derivatives")]
    let slope = (f64::from(share) * mean) as f32;
    let mut sum = 0.0;
    for channel in channels {
        let drawn = drawn.plane(channel).par_chunks(width);
        let wanted = target.picture().plane(channel).par_chunks(width);
        let weights = target.weights().par_chunks(width);
        let by_pixel = by_pixel.plane_mut(channel).par_chunks_mut(width);
        let rows: Vec<f64> = (by_pixel, drawn, wanted, weights)
            .into_par_iter()
            .map(|(by_pixel, drawn, wanted, weights)| {
                dispatch!(level, simd => row(simd, by_pixel, drawn, wanted, weights, slope))
            })
            .collect();
        sum += rows.iter().sum::<f64>();
    }
    Ok(sum * mean)
}

/// Adds the derivatives of a row and returns its weighted sum of differences.
#[inline(always)]
fn row<S: Simd>(
    simd: S,
    by_pixel: &mut [f32],
    drawn: &[f32],
    wanted: &[f32],
    weights: &[f32],
    slope: f32,
) -> f64 {
    let none = f32x8::splat(simd, 0.0);
    let mut sum = none;
    for at in (0..by_pixel.len()).step_by(LANES) {
        let difference = load(simd, drawn, at) - load(simd, wanted, at);
        let weight = load(simd, weights, at);
        // Past the row's end there is no number.
        let there: mask32x8<S> = !weight.is_nan();
        sum += there.select(weight * difference.abs(), none);
        let derivative = (weight * slope).copysign(difference);
        let differs: mask32x8<S> = difference.simd_ne(0.0);
        add_to(simd, by_pixel, at, differs.select(derivative, none));
    }
    let mut total = 0.0;
    for lane in sum.to_array() {
        total += f64::from(lane);
    }
    total
}
