//! Mean absolute differences.

use super::Target;
use crate::error::GradientError;
use crate::picture::{CHANNELS, Picture};
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
    let width = drawn.width().max(1);
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
        let rows: Vec<f32> = (by_pixel, drawn, wanted, weights)
            .into_par_iter()
            .map(|(by_pixel, drawn, wanted, weights)| row(by_pixel, drawn, wanted, weights, slope))
            .collect();
        sum += rows.iter().map(|row| f64::from(*row)).sum::<f64>();
    }
    Ok(sum * mean)
}

/// Adds the derivatives of a row and returns its weighted sum of differences.
fn row(by_pixel: &mut [f32], drawn: &[f32], wanted: &[f32], weights: &[f32], slope: f32) -> f32 {
    let mut sum = 0.0;
    let pixels = drawn.iter().zip(wanted).zip(weights);
    for (by_pixel, ((drawn, wanted), weight)) in by_pixel.iter_mut().zip(pixels) {
        let difference = drawn - wanted;
        sum += weight * difference.abs();
        if difference != 0.0 {
            *by_pixel += (weight * slope).copysign(difference);
        }
    }
    sum
}
