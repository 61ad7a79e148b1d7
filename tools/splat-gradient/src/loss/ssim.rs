//! Structural similarity (Wang, Bovik, Sheikh and Simoncelli, "Image Quality Assessment: From Error Visibility to Structural
//! Similarity", 2004): windows of 11x11 pixels weighed by a Gaussian of 1.5 pixels, K1 = 0.01, K2 = 0.03, a range of 1. Beyond the
//! picture's edge both pictures are 0, as 3DGS' training has it.

use super::Target;
use crate::error::GradientError;
use crate::picture::{CHANNELS, Picture};
use crate::vector::{Eight, LANES, add_to, load, three};
use fearless_simd::{Level, dispatch, f32x8, prelude::*};
use rayon::prelude::*;

/// Pixels along a window's sides.
const WINDOW: usize = 11;
/// Pixels from a window's middle to its edge.
const REACH: usize = WINDOW / 2;
const C1: f32 = 0.01 * 0.01;
const C2: f32 = 0.03 * 0.03;

/// Computes the SSIM loss; keeps its memory from one picture to the next.
#[derive(Debug, Clone)]
pub struct Ssim {
    level: Level,
    drawn: Vec<f32>,
    wanted: Vec<f32>,
    weights: Vec<f32>,
    /// Derivatives by each window's mean, mean square and mean product.
    maps: [Vec<f32>; 3],
}

impl Default for Ssim {
    fn default() -> Self {
        Self::new()
    }
}

impl Ssim {
    /// Uses the widest vectors that this processor has.
    #[must_use]
    pub fn new() -> Self {
        Self {
            level: Level::new(),
            drawn: Vec::new(),
            wanted: Vec::new(),
            weights: Vec::new(),
            maps: [Vec::new(), Vec::new(), Vec::new()],
        }
    }

    /// The loss 1 - SSIM (paper, section IV-C): the mean over red, green, blue and the weighted pixels as windows' middles.
    ///
    /// # Errors
    /// Pictures of different sizes.
    pub fn loss(
        &mut self,
        drawn: &Picture,
        target: &Target,
        share: f32,
        by_pixel: &mut Picture,
    ) -> Result<f64, GradientError> {
        target.check(drawn, by_pixel)?;
        let level = self.level;
        let Some(sheet) = Sheet::around(drawn, target.picture()) else {
            return Ok(0.0);
        };
        let colours = CHANNELS - 1;
        #[expect(clippy::cast_precision_loss, reason = "three channels")]
        let mean = target.inverse_sum() / colours as f64;
        #[expect(clippy::cast_possible_truncation, reason = "a factor of derivatives")]
        let slope = (f64::from(share) * -mean) as f32;
        sheet.lay(target.weights(), &mut self.weights);
        for map in &mut self.maps {
            // The margins are read and never written: nothing of a picture of another width may be left there.
            map.clear();
            map.resize(sheet.stride * sheet.height, 0.0);
        }
        let mut sum = 0.0;
        for channel in 0..colours {
            sheet.lay(drawn.plane(channel), &mut self.drawn);
            sheet.lay(target.picture().plane(channel), &mut self.wanted);
            let pictures = Pair {
                sheet,
                drawn: &self.drawn,
                wanted: &self.wanted,
            };
            let weights = self.weights.par_chunks(sheet.stride);
            let [means, squares, products] = &mut self.maps;
            let rows: Vec<f64> = (
                means.par_chunks_mut(sheet.stride),
                squares.par_chunks_mut(sheet.stride),
                products.par_chunks_mut(sheet.stride),
                weights,
            )
                .into_par_iter()
                .enumerate()
                .map_init(
                    || Sums::new(sheet),
                    |sums, (y, (means, squares, products, weights))| {
                        let maps = [means, squares, products];
                        dispatch!(level, simd => compare(simd, &pictures, y, weights, sums, maps))
                    },
                )
                .collect();
            sum += rows.iter().sum::<f64>();
            let maps = &self.maps;
            let rows = by_pixel.plane_mut(channel).par_chunks_mut(sheet.across);
            rows.skip(sheet.top)
                .take(sheet.height)
                .enumerate()
                .for_each_init(
                    || Sums::new(sheet),
                    |sums, (y, row)| {
                        let row = &mut row[sheet.left..sheet.left + sheet.width];
                        dispatch!(level, simd => spread(simd, &pictures, y, maps, slope, sums, row));
                    },
                );
        }
        Ok(sum * mean)
    }
}

/// The part of a picture beyond which both pictures are 0, so that windows there are equal, with room beside each row: [`REACH`]
/// zeros on both sides, and up to a whole number of vectors.
#[derive(Debug, Clone, Copy)]
struct Sheet {
    /// Pixels in a row of the picture.
    across: usize,
    left: usize,
    top: usize,
    width: usize,
    height: usize,
    stride: usize,
}

impl Sheet {
    /// Nothing where both pictures are 0 everywhere. Windows reach beyond what is not 0, and from there pixels' derivatives once more.
    fn around(drawn: &Picture, wanted: &Picture) -> Option<Self> {
        let (across, down) = (drawn.width(), drawn.height());
        let (mut columns, mut rows) = (across..0, down..0);
        for channel in 0..CHANNELS - 1 {
            for plane in [drawn.plane(channel), wanted.plane(channel)] {
                for (y, row) in plane.chunks(across.max(1)).enumerate() {
                    let Some(first) = row.iter().position(|pixel| *pixel != 0.0) else {
                        continue;
                    };
                    let last = row.iter().rposition(|pixel| *pixel != 0.0);
                    columns = columns.start.min(first)..columns.end.max(last.unwrap_or(first) + 1);
                    rows = rows.start.min(y)..rows.end.max(y + 1);
                }
            }
        }
        if columns.is_empty() {
            return None;
        }
        let (left, top) = (
            columns.start.saturating_sub(2 * REACH),
            rows.start.saturating_sub(2 * REACH),
        );
        let width = (columns.end + 2 * REACH).min(across) - left;
        Some(Self {
            across,
            left,
            top,
            width,
            height: (rows.end + 2 * REACH).min(down) - top,
            stride: (width + 2 * REACH).next_multiple_of(LANES),
        })
    }

    /// Lays a plane of the picture on the sheet.
    fn lay(self, plane: &[f32], laid: &mut Vec<f32>) {
        laid.clear();
        laid.resize(self.stride * self.height, 0.0);
        let rows = plane.chunks(self.across).skip(self.top);
        for (laid, row) in laid.chunks_mut(self.stride).zip(rows) {
            laid[REACH..REACH + self.width]
                .copy_from_slice(&row[self.left..self.left + self.width]);
        }
    }
}

/// A channel of both pictures.
struct Pair<'a> {
    sheet: Sheet,
    drawn: &'a [f32],
    wanted: &'a [f32],
}

/// Sums over eleven rows, of up to five quantities; with a vector's room at the end.
struct Sums([Vec<f32>; 5]);

impl Sums {
    fn new(sheet: Sheet) -> Self {
        Self([(); 5].map(|()| vec![0.0; sheet.stride + 2 * LANES]))
    }
}

/// exp(-x^2 / (2 1.5^2)) at -5..=5, made to sum to 1.
const WEIGHTS: [f32; WINDOW] = [
    0.001_028_38,
    0.007_598_758,
    0.036_000_773,
    0.109_360_69,
    0.213_005_54,
    0.266_011_72,
    0.213_005_54,
    0.109_360_69,
    0.036_000_773,
    0.007_598_758,
    0.001_028_38,
];

/// Rows of the picture in the window of row `y`, each with its weight.
fn window_rows(sheet: Sheet, y: usize) -> impl Iterator<Item = (usize, f32)> {
    let rows = (y + REACH).min(sheet.height - 1);
    (y.saturating_sub(REACH)..=rows).map(move |row| (row, WEIGHTS[row + REACH - y]))
}

/// The weighted sum of the eleven numbers from each of eight places on.
#[inline(always)]
fn across<S: Simd>(simd: S, sums: &[f32], at: usize) -> Eight<S> {
    let mut sum = f32x8::splat(simd, 0.0);
    let window = &sums[at..at + WINDOW - 1 + LANES];
    for (k, weight) in WEIGHTS.iter().enumerate() {
        sum = f32x8::from_slice(simd, &window[k..k + LANES]).mul_add(*weight, sum);
    }
    sum
}

/// One row of windows' middles: returns the weighted sum of 1 - SSIM, and writes SSIM's derivatives by the windows' mean of the drawn
/// picture, by the mean of its square and by the mean of the product of both, times the weights.
#[inline(always)]
fn compare<S: Simd>(
    simd: S,
    pictures: &Pair<'_>,
    y: usize,
    weights: &[f32],
    sums: &mut Sums,
    maps: [&mut [f32]; 3],
) -> f64 {
    let sheet = pictures.sheet;
    for at in (0..sheet.stride).step_by(LANES) {
        let mut five = [f32x8::splat(simd, 0.0); 5];
        for (row, weight) in window_rows(sheet, y) {
            let from = row * sheet.stride + at;
            let x = f32x8::from_slice(simd, &pictures.drawn[from..from + LANES]);
            let y = f32x8::from_slice(simd, &pictures.wanted[from..from + LANES]);
            let (weighted_x, weighted_y) = (x * weight, y * weight);
            five[0] += weighted_x;
            five[1] += weighted_y;
            five[2] = weighted_x.mul_add(x, five[2]);
            five[3] = weighted_y.mul_add(y, five[3]);
            five[4] = weighted_x.mul_add(y, five[4]);
        }
        for (sums, five) in sums.0.iter_mut().zip(five) {
            five.store_slice(&mut sums[at..at + LANES]);
        }
    }
    let [means, squares, products] = maps;
    let mut total = f32x8::splat(simd, 0.0);
    // A window's sums begin REACH before its middle: at the middle's column, without the margin.
    for at in (0..sheet.width).step_by(LANES) {
        let [mean_x, mean_y, xx] = three!(k => across(simd, &sums.0[k], at));
        let (yy, xy) = (across(simd, &sums.0[3], at), across(simd, &sums.0[4], at));
        let (square_x, square_y, product) = (mean_x * mean_x, mean_y * mean_y, mean_x * mean_y);
        let a1 = product * 2.0 + C1;
        let a2 = (xy - product) * 2.0 + C2;
        let b1 = square_x + square_y + C1;
        let b2 = (xx - square_x) + (yy - square_y) + C2;
        let inverse = 1.0 / (b1 * b2);
        let similar = a1 * a2 * inverse;
        // Beyond the picture the weights are 0.
        let there = weights_at(simd, weights, at);
        let by_mean =
            mean_y * (a2 - a1) * inverse * 2.0 + mean_x * similar * 2.0 * (1.0 / b2 - 1.0 / b1);
        let by_square = similar / b2 * -1.0;
        let by_product = a1 * inverse * 2.0;
        total = (1.0 - similar).mul_add(there, total);
        let out = REACH + at;
        store(simd, means, out, by_mean * there);
        store(simd, squares, out, by_square * there);
        store(simd, products, out, by_product * there);
    }
    let mut sum = 0.0;
    for lane in total.to_array() {
        sum += f64::from(lane);
    }
    sum
}

/// The weights of eight middles from column `at` on; 0 beyond the row.
#[inline(always)]
fn weights_at<S: Simd>(simd: S, weights: &[f32], at: usize) -> Eight<S> {
    let row = weights.get(REACH + at..).unwrap_or_default();
    if let Some(eight) = row.get(..LANES) {
        return f32x8::from_slice(simd, eight);
    }
    let mut eight = [0.0; LANES];
    eight[..row.len()].copy_from_slice(row);
    f32x8::load_array(simd, eight)
}

/// Writes as many of eight numbers as the row has room for.
#[inline(always)]
fn store<S: Simd>(_: S, row: &mut [f32], at: usize, numbers: Eight<S>) {
    let row = row.get_mut(at..).unwrap_or_default();
    if let Some(eight) = row.get_mut(..LANES) {
        numbers.store_slice(eight);
        return;
    }
    for (number, source) in row.iter_mut().zip(numbers.to_array()) {
        *number = source;
    }
}

/// Adds the derivatives of `slope` times the sum of SSIM by a row of the drawn picture: every window's, spread over its pixels.
#[inline(always)]
fn spread<S: Simd>(
    simd: S,
    pictures: &Pair<'_>,
    y: usize,
    maps: &[Vec<f32>; 3],
    slope: f32,
    sums: &mut Sums,
    by_pixel: &mut [f32],
) {
    let sheet = pictures.sheet;
    for at in (0..sheet.stride).step_by(LANES) {
        let mut three = [f32x8::splat(simd, 0.0); 3];
        for (row, weight) in window_rows(sheet, y) {
            let from = row * sheet.stride + at;
            for (sum, map) in three.iter_mut().zip(maps) {
                let there = f32x8::from_slice(simd, &map[from..from + LANES]);
                *sum = there.mul_add(weight, *sum);
            }
        }
        for (sums, three) in sums.0.iter_mut().zip(three) {
            three.store_slice(&mut sums[at..at + LANES]);
        }
    }
    let row = y * sheet.stride..(y + 1) * sheet.stride;
    let (drawn, wanted) = (&pictures.drawn[row.clone()], &pictures.wanted[row]);
    for at in (0..sheet.width).step_by(LANES) {
        let [by_mean, by_square, by_product] = three!(k => across(simd, &sums.0[k], at));
        let x = load(simd, drawn, REACH + at);
        let y = load(simd, wanted, REACH + at);
        let derivative = by_mean + by_square * x * 2.0 + by_product * y;
        add_to(simd, by_pixel, at, derivative * slope);
    }
}
