//! Eight numbers at a time: what F_m2g needs of vectors, frames and quaternions, one Gaussian a lane.

use fearless_simd::{f32x8, prelude::*};

/// Numbers in a vector.
pub(crate) const LANES: usize = 8;
/// One number of eight Gaussians.
pub(crate) type Eight<S> = f32x8<S>;
/// Three-dimensional vectors of eight Gaussians.
pub(crate) type Three<S> = [f32x8<S>; 3];
/// Quaternions x, y, z, w of eight Gaussians.
pub(crate) type Four<S> = [f32x8<S>; 4];

/// Eight numbers from `at` on; 0 beyond the end.
#[inline(always)]
pub(crate) fn load<S: Simd>(simd: S, plane: &[f32], at: usize) -> Eight<S> {
    if let Some(numbers) = plane.get(at..at + LANES) {
        return f32x8::from_slice(simd, numbers);
    }
    let mut numbers = [0.0; LANES];
    for (number, source) in numbers.iter_mut().zip(plane.get(at..).unwrap_or_default()) {
        *number = *source;
    }
    f32x8::load_array(simd, numbers)
}

/// Writes eight numbers from `at` on, as far as there is room.
#[inline(always)]
pub(crate) fn store<S: Simd>(plane: &mut [f32], at: usize, numbers: Eight<S>) {
    if let Some(plane) = plane.get_mut(at..at + LANES) {
        numbers.store_slice(plane);
        return;
    }
    let rest = plane.get_mut(at..).unwrap_or_default();
    for (number, new) in rest.iter_mut().zip(numbers.to_array()) {
        *number = new;
    }
}

/// `plane` at each of the indices from `at` on; at 0 beyond their end.
#[inline(always)]
pub(crate) fn gather<S: Simd>(simd: S, plane: &[f32], indices: &[u32], at: usize) -> Eight<S> {
    let mut numbers = [0.0; LANES];
    for (number, index) in numbers
        .iter_mut()
        .zip(indices.get(at..).unwrap_or_default())
    {
        *number = plane[*index as usize];
    }
    f32x8::load_array(simd, numbers)
}

#[inline(always)]
pub(crate) fn sub<S: Simd>(a: &Three<S>, b: &Three<S>) -> Three<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(crate) fn add<S: Simd>(a: &Three<S>, b: &Three<S>) -> Three<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(crate) fn scaled<S: Simd>(a: &Three<S>, k: Eight<S>) -> Three<S> {
    [a[0] * k, a[1] * k, a[2] * k]
}

/// `a + b k`.
#[inline(always)]
pub(crate) fn add_scaled<S: Simd>(a: &Three<S>, b: &Three<S>, k: Eight<S>) -> Three<S> {
    [
        b[0].mul_add(k, a[0]),
        b[1].mul_add(k, a[1]),
        b[2].mul_add(k, a[2]),
    ]
}

#[inline(always)]
pub(crate) fn dot<S: Simd>(a: &Three<S>, b: &Three<S>) -> Eight<S> {
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

/// The sum of all products: the square of a quaternion's length where both are the same.
#[inline(always)]
pub(crate) fn dot_four<S: Simd>(a: &Four<S>, b: &Four<S>) -> Eight<S> {
    let [ax, ay, az, aw] = a;
    let [bx, by, bz, bw] = b;
    aw.mul_add(*bw, az.mul_add(*bz, ay.mul_add(*by, *ax * *bx)))
}

#[inline(always)]
pub(crate) fn scaled_four<S: Simd>(a: &Four<S>, k: Eight<S>) -> Four<S> {
    [a[0] * k, a[1] * k, a[2] * k, a[3] * k]
}

/// The quaternion product `a b`.
#[inline(always)]
pub(crate) fn product<S: Simd>(a: &Four<S>, b: &Four<S>) -> Four<S> {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (*a, *b);
    [
        aw.mul_add(bx, ax.mul_add(bw, ay.mul_sub(bz, az * by))),
        aw.mul_add(by, ay.mul_add(bw, az.mul_sub(bx, ax * bz))),
        aw.mul_add(bz, az.mul_add(bw, ax.mul_sub(by, ay * bx))),
        aw.mul_sub(bw, ax.mul_add(bx, ay.mul_add(by, az * bz))),
    ]
}

/// The conjugate quaternion.
#[inline(always)]
pub(crate) fn conjugate<S: Simd>([x, y, z, w]: &Four<S>) -> Four<S> {
    [*x * -1.0, *y * -1.0, *z * -1.0, *w]
}
