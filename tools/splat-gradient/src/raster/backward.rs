//! What the derivatives by a tile's pixels say of its splats.
//!
//! With g the derivatives by red, green, blue and alpha of a pixel, T the transmittance before splat i and C the colour behind it:
//! dL/dalpha_i = T (c_i . g) - (sum of what lies behind . g - g_alpha T_end) / (1 - alpha_i).

use super::run::{Half, STOP, open, reached};
use crate::projection::{MOMENTS, Moments};
use crate::tiles::{RUN, TILE, Tile, TilePlane};
use crate::vector::{Eight, LANES};
use fearless_simd::{f32x8, prelude::*};

/// Gathers `tile.moments` of the splats that were blended, from the derivatives by the tile's pixels.
#[inline(always)]
pub(crate) fn gather<S: Simd>(
    simd: S,
    tile: &mut Tile,
    by_pixel: &[TilePlane; 4],
    at: [usize; 2],
    size: [usize; 2],
) {
    let none = f32x8::splat(simd, 0.0);
    let (mut live, mut transmittances) = open(at, size);
    let mut behind = total(simd, tile, by_pixel);
    tile.moments.clear();
    for splat in &tile.splats[..tile.blended] {
        let meeting = reached(splat, at) & live;
        let mut sums = [none; MOMENTS];
        for half in 0..2 {
            let mut rows = (meeting >> (half * TILE)) & 0xFFFF;
            if rows == 0 {
                continue;
            }
            let met_half = Half::new(simd, splat, at[0] + half * RUN, at[1]);
            let (mut h0, mut h1, mut h2) = (none, none, none);
            while rows != 0 {
                let row = rows.trailing_zeros() as usize % TILE;
                rows &= rows - 1;
                let run = half * TILE + row;
                let before = f32x8::load_array_ref(simd, &transmittances[run]);
                let met = met_half.meet(simd, row, before);
                let weight = met.alpha * before;
                let after = before - weight;
                let mut shown = none;
                for channel in 0..3 {
                    let by_channel = f32x8::load_array_ref(simd, &by_pixel[channel][run]);
                    shown = by_channel.mul_add(splat.colour[channel], shown);
                    sums[6 + channel] = weight.mul_add(by_channel, sums[6 + channel]);
                }
                let shown = weight * shown;
                let rest = f32x8::load_array_ref(simd, &behind[run]) - shown;
                // By the logarithm of alpha: alpha dL/dalpha.
                let h = shown - rest * met.alpha / (1.0 - met.alpha);
                let h = met.follow(simd, h);
                h0 += h;
                h1 = h.mul_add(met.dy, h1);
                h2 = h.mul_add(met.dy * met.dy, h2);
                rest.store_array(&mut behind[run]);
                after.store_array(&mut transmittances[run]);
                if !after.simd_ge(STOP).any_true() {
                    live &= !(1 << run);
                }
            }
            let dx = met_half.dx;
            let h0_dx = h0 * dx;
            sums[0] += h0;
            sums[1] += h0_dx;
            sums[2] = h0_dx.mul_add(dx, sums[2]);
            sums[3] += h1;
            sums[4] = h1.mul_add(dx, sums[4]);
            sums[5] += h2;
        }
        tile.moments.push(added(sums));
    }
}

/// The sum of each vector's numbers, always in one order.
#[inline(always)]
fn added<S: Simd>(vectors: [Eight<S>; MOMENTS]) -> Moments {
    let [a, b, c, d, e, f, g, h, last] = vectors;
    let (abcd, efgh) = (
        paired(paired(a, b), paired(c, d)),
        paired(paired(e, f), paired(g, h)),
    );
    let (low, high) = last.split();
    let [p, q, r, s] = (low + high).to_array();
    let mut sums = [(p + r) + (q + s); MOMENTS];
    paired(abcd, efgh).store_slice(&mut sums[..LANES]);
    sums
}

/// Sums of neighbours: four of the first vector's, then four of the second's.
#[inline(always)]
fn paired<S: Simd>(first: Eight<S>, second: Eight<S>) -> Eight<S> {
    let (even, odd) = first.deinterleave(second);
    even + odd
}

/// Of every pixel, what is shown times its derivatives, less what shines through at the end times the derivative by alpha.
#[inline(always)]
fn total<S: Simd>(simd: S, tile: &Tile, by_pixel: &[TilePlane; 4]) -> TilePlane {
    let mut total = tile.pixels[3];
    for (run, total) in total.iter_mut().enumerate() {
        let through = f32x8::load_array_ref(simd, &tile.pixels[3][run]);
        let mut sum = through * f32x8::load_array_ref(simd, &by_pixel[3][run]) * -1.0;
        for (shown, by_channel) in tile.pixels.iter().zip(by_pixel).take(3) {
            let shown = f32x8::load_array_ref(simd, &shown[run]);
            sum = shown.mul_add(f32x8::load_array_ref(simd, &by_channel[run]), sum);
        }
        sum.store_array(total);
    }
    total
}
