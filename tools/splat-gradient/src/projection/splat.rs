//! A Gaussian on the picture.

use super::seen::see;
use crate::attributes::ATTRIBUTES;
use crate::vector::{LANES, log2, three};
use crate::view::Lens;
use fearless_simd::prelude::*;
use std::f32::consts::LN_2;

/// sqrt(log2(e) / 2): from sqrt(q) to the root of -log2 of exp(-q / 2).
const SQRT_HALF_LOG2_E: f32 = 0.849_321_8;
/// log2 of 1/255: less alpha is not drawn, as `shaders-spirv` has it.
pub(crate) const LOG2_ALPHA_CUT: f32 = -7.994_353_4;
/// Room for rounding, in log2, where a test must never drop what a pixel would have kept.
pub(crate) const ALPHA_CUT_SLACK: f32 = 1e-3;

/// The key of what is not drawn; greater than those of all depths.
pub(crate) const NEVER: u32 = u32::MAX;

/// A projected Gaussian: alpha = 2^(`log2_opacity` - (ux dx + uy dy)^2 - (w dy)^2) at dx, dy pixels from its mean.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Splat {
    /// Pixels from the left and the top edge.
    pub(crate) mean: [f32; 2],
    pub(crate) u: [f32; 2],
    pub(crate) w: f32,
    pub(crate) log2_opacity: f32,
    /// Not below 0.
    pub(crate) colour: [f32; 3],
    /// First and last column and row of pixels that it may reach, within the picture.
    pub(crate) columns: [u16; 2],
    pub(crate) rows: [u16; 2],
}

/// Numbers in [`Moments`].
pub(crate) const MOMENTS: usize = 9;

/// Sums over a splat's pixels. With h the derivative by the logarithm of alpha: h, h dx, h dx^2, h dy, h dx dy, h dy^2; then the
/// derivatives by red, green and blue.
pub(crate) type Moments = [f32; MOMENTS];

/// Projects the Gaussians from `start` on, as many as `splats` has room for. Each depth becomes a key that rises with it, [`NEVER`]
/// where nothing is drawn.
#[inline(always)]
pub(crate) fn project<S: Simd>(
    simd: S,
    lens: &Lens,
    planes: &[&[f32]; ATTRIBUTES],
    start: usize,
    splats: &mut [Splat],
    keys: &mut [u32],
) {
    let groups = splats.chunks_mut(LANES).zip(keys.chunks_mut(LANES));
    for (group, (splats, keys)) in groups.enumerate() {
        let seen = see(simd, lens, planes, start + group * LANES);
        let [a, b, c] = seen.covariance;
        let product = c * seen.determinant;
        let log2_opacity = log2(simd, seen.opacity);
        // Where alpha reaches the cut: by opacity, not by three standard deviations.
        let q_cut = (log2_opacity - LOG2_ALPHA_CUT) * (2.0 * LN_2);
        let (reach_x, reach_y) = ((q_cut * a).sqrt(), (q_cut * c).sqrt());
        let mean_x = (seen.place[0] * seen.inverse_depth).mul_add(lens.focal[0], lens.centre[0]);
        let mean_y = (seen.place[1] * seen.inverse_depth).mul_add(lens.focal[1], lens.centre[1]);
        // The first and the last pixel centre inside; there may be none.
        let first_x = (mean_x - reach_x - 0.5).ceil().max(0.0);
        let first_y = (mean_y - reach_y - 0.5).ceil().max(0.0);
        let last_x = (mean_x + reach_x - 0.5).floor().min(lens.size[0] - 1.0);
        let last_y = (mean_y + reach_y - 0.5).floor().min(lens.size[1] - 1.0);
        let drawn = seen.sound
            & q_cut.simd_gt(0.0)
            & (mean_x + mean_y + reach_x + reach_y).is_finite()
            & product.is_finite()
            & first_x.simd_le(last_x)
            & first_y.simd_le(last_y);
        keys.fill(NEVER);
        let mut left = drawn.to_bitmask();
        if left == 0 {
            continue;
        }
        let across = SQRT_HALF_LOG2_E / product.sqrt();
        let (u_x, u_y) = (across * c, across * b * -1.0);
        let w = SQRT_HALF_LOG2_E / c.sqrt();
        let colour = three!(k => seen.colour[k].max(0.0));
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            keys[lane] = seen.place[2][lane].to_bits();
            splats[lane] = Splat {
                mean: [mean_x[lane], mean_y[lane]],
                u: [u_x[lane], u_y[lane]],
                w: w[lane],
                log2_opacity: log2_opacity[lane],
                colour: three!(k => colour[k][lane]),
                columns: [pixel(first_x[lane]), pixel(last_x[lane])],
                rows: [pixel(first_y[lane]), pixel(last_y[lane])],
            };
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "held within the picture, at most 4096 pixels"
)]
fn pixel(at: f32) -> u16 {
    at as u16
}
