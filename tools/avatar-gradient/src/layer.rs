//! Fully connected layers of one input, SiLU, and their derivatives.

use crate::parameters::Layer;
use crate::planes::{RUN, add_scaled, dot};
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;

/// y = x W + b. `y` has as many numbers as the bias.
pub(crate) fn forward(level: Level, layer: &Layer, x: &[f32], y: &mut Vec<f32>) {
    let outputs = layer.bias.len();
    y.resize(outputs, 0.0);
    let runs = y.par_chunks_mut(RUN).enumerate();
    runs.for_each(|(run, y)| {
        dispatch!(level, simd => {
            let _ = simd;
            let start = run * RUN;
            y.copy_from_slice(&layer.bias[start..start + y.len()]);
            for (row, x) in layer.weights.chunks_exact(outputs).zip(x) {
                // Most of an expression is 0.
                if *x != 0.0 {
                    add_scaled(y, &row[start..start + y.len()], *x);
                }
            }
        });
    });
}

/// Adds the derivatives by the weights and the bias, of those by y, to `gradient`; writes those by x.
pub(crate) fn backward(
    level: Level,
    layer: &Layer,
    x: &[f32],
    by_y: &[f32],
    gradient: &mut Layer,
    by_x: &mut Vec<f32>,
) {
    by_x.resize(x.len(), 0.0);
    let outputs = by_y.len();
    if outputs == 0 {
        by_x.fill(0.0);
        return;
    }
    let rows = layer.weights.par_chunks_exact(outputs);
    rows.zip(gradient.weights.par_chunks_exact_mut(outputs))
        .zip(x.par_iter().zip(by_x.par_iter_mut()))
        .with_min_len(RUN.div_ceil(outputs))
        .for_each(|((row, by_row), (x, by_x))| {
            dispatch!(level, simd => {
                let _ = simd;
                *by_x = dot(row, by_y);
                if *x != 0.0 {
                    add_scaled(by_row, by_y, *x);
                }
            });
        });
    add_scaled(&mut gradient.bias, by_y, 1.0);
}

/// x sigmoid(x) of every number.
pub(crate) fn silu(before: &[f32], after: &mut Vec<f32>) {
    after.clear();
    after.extend(before.iter().map(|x| x / (1.0 + (-x).exp())));
}

/// Turns the derivatives by SiLU's results into those by what it was given.
pub(crate) fn silu_backward(before: &[f32], by: &mut [f32]) {
    for (x, by) in before.iter().zip(by) {
        let gate = 1.0 / (1.0 + (-x).exp());
        *by *= gate * (1.0 + x * (1.0 - gate));
    }
}
