//! L_scale: Gaussians that are too large.

use crate::error::{ModelError, check_count};
use crate::planes::{RUN, planes, planes_mut};
use rayon::prelude::*;
use splat_gradient::{Attributes, attributes::plane};
use spmm3::ATTRIBUTES;

/// The paper's L_scale (section IV-C): sum of max(|s_i| - `threshold`, 0) with s_i the three standard deviations of a Gaussian, metres.
///
/// # Errors
/// Derivatives of another number of Gaussians.
#[expect(
    clippy::cast_possible_truncation,
    reason = "derivatives are single precision"
)]
pub fn scale(
    gaussians: &Attributes,
    threshold: f32,
    weight: f32,
    by_gaussians: &mut Attributes,
) -> Result<f64, ModelError> {
    check_count(
        "derivatives by Gaussians",
        by_gaussians.len(),
        gaussians.len(),
    )?;
    let all: [&[f32]; ATTRIBUTES] = planes(gaussians.numbers());
    let by: [&mut [f32]; ATTRIBUTES] = planes_mut(by_gaussians.numbers_mut());
    let [.., by_x, by_y, by_z, _, _, _, _] = by;
    let first = plane::LOG_SCALE.start;
    let runs = by_x
        .par_chunks_mut(RUN)
        .zip(by_y.par_chunks_mut(RUN).zip(by_z.par_chunks_mut(RUN)));
    let sums = runs.enumerate().map(|(run, (by_x, (by_y, by_z)))| {
        let mut sum = 0.0;
        let by = by_x.iter_mut().zip(by_y).zip(by_z);
        for (index, ((by_x, by_y), by_z)) in (run * RUN..).zip(by) {
            let squares = [0, 1, 2].map(|k| (2.0 * f64::from(all[first + k][index])).exp());
            let length = squares.iter().sum::<f64>().sqrt();
            let more = length - f64::from(threshold);
            if more > 0.0 && length.is_finite() {
                sum += more;
                let share = f64::from(weight) / length;
                for (by, square) in [by_x, by_y, by_z].into_iter().zip(squares) {
                    *by += (share * square) as f32;
                }
            }
        }
        sum
    });
    let sums: Vec<f64> = sums.collect();
    Ok(f64::from(weight) * sums.iter().sum::<f64>())
}
