//! Eight numbers at a time, and what the processor's vectors lack.

use fearless_simd::{f32x8, i32x8, prelude::*};

/// Numbers in a vector.
pub(crate) const LANES: usize = 8;
/// One number of eight Gaussians or pixels.
pub(crate) type Eight<S> = f32x8<S>;
/// Three-dimensional vectors of eight Gaussians.
pub(crate) type Three<S> = [f32x8<S>; 3];

/// 2^x, to 3e-7 of it, for x in -126..=126; any number beyond.
#[inline(always)]
pub(crate) fn exp2<S: Simd>(simd: S, x: Eight<S>) -> Eight<S> {
    // Added to this, a number is rounded, and its whole part is in the lowest bits.
    const ROUNDER: f32 = 1.5 * 8_388_608.0;
    let rounded = x + ROUNDER;
    let part = x - (rounded - ROUNDER);
    // Through Chebyshev's six nodes in -0.5..=0.5.
    let mut power = f32x8::splat(simd, 1.339_086_3e-3);
    for term in [
        9.676_032e-3,
        5.550_357e-2,
        0.240_221_07,
        std::f32::consts::LN_2,
        1.000_000_1,
    ] {
        power = power.mul_add(part, f32x8::splat(simd, term));
    }
    // The whole part goes to the exponent.
    let whole: i32x8<S> = rounded.bitcast();
    let bits: i32x8<S> = power.bitcast();
    (bits + (whole << 23)).bitcast()
}

/// The logarithm of base 2 of normal numbers greater than 0, to 2e-7 in all.
#[inline(always)]
pub(crate) fn log2<S: Simd>(simd: S, x: Eight<S>) -> Eight<S> {
    // x = 2^exponent m with m in sqrt(1/2)..sqrt(2).
    let bits: i32x8<S> = x.bitcast();
    let exponent = (bits - 0x3F35_04F3) >> 23;
    let mantissa: Eight<S> = (bits - (exponent << 23)).bitcast();
    // ln m = 2 artanh s, s = (m - 1) / (m + 1).
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let square = s * s;
    let mut sum = f32x8::splat(simd, 1.0 / 9.0);
    for term in [1.0 / 7.0, 1.0 / 5.0, 1.0 / 3.0, 1.0] {
        sum = sum.mul_add(square, f32x8::splat(simd, term));
    }
    let whole: Eight<S> = exponent.to_float();
    (s * sum).mul_add(2.0 * std::f32::consts::LOG2_E, whole)
}

/// An array of three, as an expression says for each index. Not a closure given to `map`: what is compiled apart from its caller does
/// not have the processor's vectors.
macro_rules! three {
    ($index:ident => $value:expr) => {
        [
            {
                let $index = 0usize;
                $value
            },
            {
                let $index = 1usize;
                $value
            },
            {
                let $index = 2usize;
                $value
            },
        ]
    };
}
pub(crate) use three;

/// Eight numbers from `at` on; NaN beyond the end.
#[inline(always)]
pub(crate) fn load<S: Simd>(simd: S, plane: &[f32], at: usize) -> Eight<S> {
    if let Some(numbers) = plane.get(at..at + LANES) {
        return f32x8::from_slice(simd, numbers);
    }
    let mut numbers = [f32::NAN; LANES];
    for (number, source) in numbers.iter_mut().zip(plane.get(at..).unwrap_or_default()) {
        *number = *source;
    }
    f32x8::load_array(simd, numbers)
}

/// Adds eight numbers to those from `at` on, as far as there are any.
#[inline(always)]
pub(crate) fn add_to<S: Simd>(simd: S, plane: &mut [f32], at: usize, more: Eight<S>) {
    if let Some(numbers) = plane.get_mut(at..at + LANES) {
        (f32x8::from_slice(simd, numbers) + more).store_slice(numbers);
        return;
    }
    let rest = plane.get_mut(at..).unwrap_or_default();
    for (number, more) in rest.iter_mut().zip(more.to_array()) {
        *number += more;
    }
}

#[inline(always)]
pub(crate) fn dot<S: Simd>(a: &Three<S>, b: &Three<S>) -> Eight<S> {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

/// The product with a vector that is the same for all eight.
#[inline(always)]
pub(crate) fn dot_same<S: Simd>(a: &Three<S>, b: [f32; 3]) -> Eight<S> {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

#[inline(always)]
pub(crate) fn cross<S: Simd>(a: &Three<S>, b: &Three<S>) -> Three<S> {
    [
        a[1].mul_sub(b[2], a[2] * b[1]),
        a[2].mul_sub(b[0], a[0] * b[2]),
        a[0].mul_sub(b[1], a[1] * b[0]),
    ]
}

/// `a s + b t`.
#[inline(always)]
pub(crate) fn mixed<S: Simd>(a: &Three<S>, s: Eight<S>, b: &Three<S>, t: Eight<S>) -> Three<S> {
    [
        a[0].mul_add(s, b[0] * t),
        a[1].mul_add(s, b[1] * t),
        a[2].mul_add(s, b[2] * t),
    ]
}
