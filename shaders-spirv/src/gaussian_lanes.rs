//! Packing many Gaussians at once: [`PackedGaussian::new`] on vectors, one Gaussian a lane, to the same bits.
//!
//! Functions and no closures: what is not `#[inline(always)]` loses the processor's vectors, and a closure in a `let`
//! cannot say so. The two are side by side because they are one layout; a test compares them. The caller has chosen the
//! processor's vectors (`fearless_simd::dispatch`).

use crate::gaussian::{
    HALF_LEAST, HALF_MOST, HALF_REBIAS, HALF_STEP, LOG2_SCALE_END, PackedGaussian, ROTATION_MOST,
    SCALE_LEAST, SCALE_STEPS,
};
use fearless_simd::prelude::*;
use std::f32::consts::FRAC_1_SQRT_2;

/// As many Gaussians as the processor's vectors have lanes, in the terms of [`PackedGaussian::new`].
#[derive(Debug, Clone, Copy)]
pub struct GaussianLanes<S: Simd> {
    /// World positions, metres.
    pub position: [S::f32s; 3],
    /// Quaternions x, y, z, w of any length.
    pub rotation: [S::f32s; 4],
    /// Logarithms (base 2) of the scales, metres.
    pub log2_scale: [S::f32s; 3],
    /// Opacities 0..=1.
    pub opacity: S::f32s,
    /// Display colours.
    pub colour: [S::f32s; 3],
}

impl<S: Simd> GaussianLanes<S> {
    /// How many Gaussians there are.
    pub const LEN: usize = S::f32s::LEN;

    /// Packs all of them into `out`: each written once, whole, in order and never read, so that the memory may be mapped
    /// from a device.
    ///
    /// # Panics
    /// If `out` does not hold exactly [`Self::LEN`].
    #[inline(always)]
    pub fn pack(&self, simd: S, out: &mut [PackedGaussian]) {
        let [a, b, c, d, e, f, g, h] = self.words(simd);
        // Three perfect shuffles of the eight vectors laid end to end: from word by word to Gaussian by Gaussian.
        let ((a, b), (c, d), (e, f), (g, h)) = (
            a.interleave(e),
            b.interleave(f),
            c.interleave(g),
            d.interleave(h),
        );
        let ((a, b), (c, d), (e, f), (g, h)) = (
            a.interleave(e),
            b.interleave(f),
            c.interleave(g),
            d.interleave(h),
        );
        let ((a, b), (c, d), (e, f), (g, h)) = (
            a.interleave(e),
            b.interleave(f),
            c.interleave(g),
            d.interleave(h),
        );
        let out: &mut [u32] = bytemuck::cast_slice_mut(out);
        assert_eq!(out.len(), 8 * Self::LEN, "one Gaussian a lane");
        for (vector, out) in [a, b, c, d, e, f, g, h]
            .iter()
            .zip(out.chunks_exact_mut(Self::LEN))
        {
            vector.store_slice(out);
        }
    }

    /// The eight words of [`PackedGaussian`], one lane a Gaussian. Every operation is the scalar one's, in its order.
    #[inline(always)]
    fn words(&self, simd: S) -> [S::u32s; 8] {
        let [x, y, z, w] = self.rotation;
        let length = x * x + y * y + z * z + w * w;
        let [px, py, pz] = self.position;
        let [red, green, blue] = self.colour;
        let sum = px + py + pz + red + green + blue + self.opacity + length;
        let [sx, sy, sz] = self.log2_scale;
        let drawn = sum.is_finite()
            & length.simd_gt(0.0)
            & sx.simd_lt(LOG2_SCALE_END)
            & sy.simd_lt(LOG2_SCALE_END)
            & sz.simd_lt(LOG2_SCALE_END);

        let inverse_length = S::f32s::splat(simd, 1.0) / length.sqrt();
        let unit = [
            x * inverse_length,
            y * inverse_length,
            z * inverse_length,
            w * inverse_length,
        ];
        let (largest, [a, b, c]) = smallest_three(simd, unit);
        let (sx, sy, sz) = (
            scale_steps(simd, sx),
            scale_steps(simd, sy),
            scale_steps(simd, sz),
        );
        let alpha = quantised(simd, self.opacity * 65_535.0, 65_535.0);
        let (red, green, blue) = (
            half_bits(simd, red),
            half_bits(simd, green),
            half_bits(simd, blue),
        );
        let mut words: [S::u32s; 8] = [
            px.bitcast(),
            py.bitcast(),
            pz.bitcast(),
            sx | (sy << 16),
            sz | (alpha << 16),
            a | (b << 15) | (largest << 30),
            c | (red << 16),
            green | (blue << 16),
        ];
        for word in &mut words {
            *word = drawn.select(*word, S::u32s::splat(simd, 0));
        }
        words
    }
}

/// A scale's logarithm as it is stored.
#[inline(always)]
fn scale_steps<S: Simd>(simd: S, log: S::f32s) -> S::u32s {
    quantised(simd, (log - SCALE_LEAST) * SCALE_STEPS, 65_535.0)
}

/// [`crate::smallest_three`].
#[inline(always)]
fn smallest_three<S: Simd>(simd: S, [x, y, z, w]: [S::f32s; 4]) -> (S::u32s, [S::u32s; 3]) {
    let (ax, ay, az, aw) = (x.abs(), y.abs(), z.abs(), w.abs());
    // Chosen from the last to the first, so that the first match wins.
    let is_x = ax.simd_ge(ay) & ax.simd_ge(az) & ax.simd_ge(aw);
    let is_y = ay.simd_ge(az) & ay.simd_ge(aw);
    let is_z = az.simd_ge(aw);
    let left_out = is_x.select(x, is_y.select(y, is_z.select(z, w)));
    let largest = is_x.select(
        S::u32s::splat(simd, 0),
        is_y.select(
            S::u32s::splat(simd, 1),
            is_z.select(S::u32s::splat(simd, 2), S::u32s::splat(simd, 3)),
        ),
    );
    let (a, b, c) = (
        is_x.select(y, x),
        (is_x | is_y).select(z, y),
        (is_x | is_y | is_z).select(w, z),
    );
    let scale = S::f32s::splat(simd, FRAC_1_SQRT_2).copysign(left_out);
    let steps = [
        rotation_steps(simd, a * scale),
        rotation_steps(simd, b * scale),
        rotation_steps(simd, c * scale),
    ];
    (largest, steps)
}

/// One of a quaternion's three smallest numbers, halved by the square root of 2, as it is stored.
#[inline(always)]
fn rotation_steps<S: Simd>(simd: S, number: S::f32s) -> S::u32s {
    quantised(simd, (number + 0.5) * ROTATION_MOST, ROTATION_MOST)
}

/// [`crate::quantised`], for a value that is a number and a `most` of 16 bits.
#[inline(always)]
fn quantised<S: Simd>(simd: S, value: S::f32s, most: f32) -> S::u32s {
    let held = value.max(S::f32s::splat(simd, 0.0)).min(most) + 0.5;
    // To signed first: only the newest processors have the other.
    held.to_int::<S::i32s>().bitcast()
}

/// [`crate::gaussian::half_bits`].
#[inline(always)]
fn half_bits<S: Simd>(simd: S, value: S::f32s) -> S::u32s {
    let bits: S::u32s = value.min(HALF_MOST).bitcast();
    let half = (bits + HALF_STEP - HALF_REBIAS) >> 13;
    value
        .simd_lt(HALF_LEAST)
        .select(S::u32s::splat(simd, 0), half)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use fearless_simd::{Level, dispatch};

    /// 14 numbers of a Gaussian: position, rotation, scale, opacity, colour.
    type Numbers = [f32; 14];

    #[inline(always)]
    fn pack_lanes<S: Simd>(simd: S, gaussians: &[Numbers]) -> Vec<PackedGaussian> {
        let len = GaussianLanes::<S>::LEN;
        gaussians
            .chunks(len)
            .flat_map(|chunk| {
                let plane =
                    |p: usize| S::f32s::from_fn(simd, |lane| chunk.get(lane).map_or(0.0, |g| g[p]));
                let lanes = GaussianLanes::<S> {
                    position: [0, 1, 2].map(plane),
                    rotation: [3, 4, 5, 6].map(plane),
                    log2_scale: [7, 8, 9].map(plane),
                    opacity: plane(10),
                    colour: [11, 12, 13].map(plane),
                };
                let mut out = vec![PackedGaussian::zeroed(); len];
                lanes.pack(simd, &mut out);
                out.truncate(chunk.len());
                out
            })
            .collect()
    }

    fn one_by_one(gaussian: &Numbers) -> PackedGaussian {
        let [px, py, pz, x, y, z, w, sx, sy, sz, opacity, r, g, b] = *gaussian;
        PackedGaussian::new([px, py, pz], [x, y, z, w], [sx, sy, sz], opacity, [r, g, b])
    }

    #[test]
    fn vectors_pack_to_the_same_bits_as_single_gaussians() {
        let mut state = 0x3D65_u64;
        let mut random = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            f32::from(u16::try_from(state >> 48).expect("16 bits")) / 65_536.0
        };
        let mut gaussians: Vec<Numbers> = (0..20_000)
            .map(|_| {
                std::array::from_fn(|plane| match plane {
                    0..3 => 20.0 * random() - 10.0,
                    3..7 => 2.0 * random() - 1.0,
                    7..10 => 40.0 * random() - 30.0,
                    10 => 1.4 * random() - 0.2,
                    _ => 3.0 * random() - 1.0,
                })
            })
            .collect();
        // Numbers at the borders, in every place.
        let odd = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            f32::MIN_POSITIVE,
            0.0,
            -0.0,
            8.0,
            6.103_515_6e-5,
            1e9,
            -1e9,
        ];
        for plane in 0..14 {
            for number in odd {
                let mut gaussian = gaussians[plane];
                gaussian[plane] = number;
                gaussians.push(gaussian);
            }
        }
        for half in [0.5, -0.5, FRAC_1_SQRT_2, 0.0] {
            let mut equal = gaussians[0];
            equal[3..7].fill(half);
            gaussians.push(equal);
            equal[4] = -half;
            gaussians.push(equal);
        }
        let expected: Vec<PackedGaussian> = gaussians.iter().map(one_by_one).collect();
        for level in levels() {
            let got = dispatch!(level, simd => pack_lanes(simd, &gaussians));
            for ((gaussian, got), expected) in gaussians.iter().zip(&got).zip(&expected) {
                assert_eq!(got, expected, "{gaussian:?} at {level:?}");
            }
        }
    }

    /// This processor's SIMD levels, the narrowest first.
    fn levels() -> Vec<Level> {
        let new = Level::new();
        #[cfg(target_arch = "x86_64")]
        let more = [
            new.as_sse4_2().map(Level::Sse4_2),
            new.as_avx2().map(Level::Avx2),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let more: [Option<Level>; 0] = [];
        [Level::baseline(), new]
            .into_iter()
            .chain(more.into_iter().flatten())
            .collect()
    }
}
