//! Structural similarity, in double precision.
//!
//! Wang, Bovik, Sheikh and Simoncelli, "Image Quality Assessment: From Error Visibility to Structural Similarity", 2004: windows of 11 x 11
//! pixels weighed by a Gaussian of 1.5 pixels, K1 = 0.01, K2 = 0.03, a range of 1. Beyond the edges both pictures are 0, as 3DGS has it.
//! Written apart from the loss that avatars are trained with.

use super::canvas::Canvas;
use rayon::prelude::*;

/// Pixels from a window's middle to its edge.
const REACH: usize = 5;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// The window along one axis; its sum is 1.
fn window() -> [f64; 2 * REACH + 1] {
    let mut window = [0.0; 2 * REACH + 1];
    for (k, weight) in window.iter_mut().enumerate() {
        let away = k as f64 - REACH as f64;
        *weight = (-away * away / (2.0 * SIGMA * SIGMA)).exp();
    }
    let sum: f64 = window.iter().sum();
    window.map(|weight| weight / sum)
}

/// Every pixel's mean over its window.
fn blurred(values: &[f64], width: usize) -> Vec<f64> {
    let window = window();
    let height = values.len() / width.max(1);
    let along = |values: &[f64], x: usize, y: usize, down: bool| -> f64 {
        let (at, count) = if down { (y, height) } else { (x, width) };
        (window.iter().enumerate())
            .filter_map(|(k, weight)| {
                let there = (at + k).checked_sub(REACH).filter(|there| *there < count)?;
                let index = if down {
                    there * width + x
                } else {
                    y * width + there
                };
                Some(weight * values[index])
            })
            .sum()
    };
    let pass = |values: &[f64], down: bool| -> Vec<f64> {
        (0..values.len())
            .into_par_iter()
            .map(|pixel| along(values, pixel % width, pixel / width, down))
            .collect()
    };
    pass(&pass(values, false), true)
}

/// The similarity around every pixel, -1..=1, the mean of the three colours.
pub(super) fn map(a: &Canvas, b: &Canvas) -> Vec<f64> {
    let mut similarity = vec![0.0; a.pixels.len()];
    for channel in 0..3 {
        let (x, y) = (a.plane(channel), b.plane(channel));
        let product = |x: &[f64], y: &[f64]| -> Vec<f64> {
            let products: Vec<f64> = x.iter().zip(y).map(|(x, y)| x * y).collect();
            blurred(&products, a.width)
        };
        let (mean_x, mean_y) = (blurred(&x, a.width), blurred(&y, a.width));
        let (xx, yy, xy) = (product(&x, &x), product(&y, &y), product(&x, &y));
        for (pixel, sum) in similarity.iter_mut().enumerate() {
            let (mx, my) = (mean_x[pixel], mean_y[pixel]);
            let (vx, vy) = (xx[pixel] - mx * mx, yy[pixel] - my * my);
            let covariance = xy[pixel] - mx * my;
            let numerator = (2.0 * mx * my + C1) * (2.0 * covariance + C2);
            *sum += numerator / ((mx * mx + my * my + C1) * (vx + vy + C2)) / 3.0;
        }
    }
    similarity
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(seed: u64, width: usize, height: usize) -> Canvas {
        let mut rng = fastrand::Rng::with_seed(seed);
        let pixels = (0..width * height)
            .map(|_| [rng.f32(), rng.f32(), rng.f32()])
            .collect();
        Canvas::new(width, pixels)
    }

    /// The definition, window by window, with two-dimensional weights and centred moments.
    #[expect(clippy::cast_possible_truncation, reason = "within a small picture")]
    fn by_definition(a: &Canvas, b: &Canvas, x: i64, y: i64) -> f64 {
        let (width, height) = (a.width as i64, a.height() as i64);
        let at = |canvas: &Canvas, x: i64, y: i64, channel: usize| {
            if (0..width).contains(&x) && (0..height).contains(&y) {
                f64::from(canvas.pixels[(y * width + x) as usize][channel])
            } else {
                0.0
            }
        };
        let weight = |dx: i64, dy: i64| (-((dx * dx + dy * dy) as f64) / 4.5).exp();
        let all: Vec<(i64, i64)> = (-5..=5)
            .flat_map(|dy| (-5..=5).map(move |dx| (dx, dy)))
            .collect();
        let total: f64 = all.iter().map(|(dx, dy)| weight(*dx, *dy)).sum();
        let mean = |of: &dyn Fn(i64, i64) -> f64| -> f64 {
            all.iter()
                .map(|(dx, dy)| weight(*dx, *dy) / total * of(*dx, *dy))
                .sum()
        };
        (0..3)
            .map(|c| {
                let ma = mean(&|dx, dy| at(a, x + dx, y + dy, c));
                let mb = mean(&|dx, dy| at(b, x + dx, y + dy, c));
                let va = mean(&|dx, dy| (at(a, x + dx, y + dy, c) - ma).powi(2));
                let vb = mean(&|dx, dy| (at(b, x + dx, y + dy, c) - mb).powi(2));
                let cov = mean(&|dx, dy| {
                    (at(a, x + dx, y + dy, c) - ma) * (at(b, x + dx, y + dy, c) - mb)
                });
                (2.0 * ma * mb + 1e-4) * (2.0 * cov + 9e-4)
                    / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4))
                    / 3.0
            })
            .sum()
    }

    #[test]
    fn the_map_is_the_definitions_at_every_pixel() {
        let (a, b) = (noise(1, 23, 17), noise(2, 23, 17));
        for (pixel, similarity) in map(&a, &b).into_iter().enumerate() {
            let wanted = by_definition(&a, &b, (pixel % 23) as i64, (pixel / 23) as i64);
            assert!(
                (similarity - wanted).abs() < 1e-9,
                "{similarity}, not {wanted}"
            );
        }
        assert!(
            map(&a, &a).iter().all(|value| (value - 1.0).abs() < 1e-9),
            "a picture is like itself"
        );
    }
}
