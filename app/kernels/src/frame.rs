//! The geometry of F_m2g on vectors: a triangle's frame as a rotation, one triangle a lane.
//!
//! As `spmm3::triangle_frame` and glam compute it, collapsed triangles included, without branches.

use fearless_simd::prelude::*;

/// A 3D vector in every lane.
pub(super) type V3<S> = [<S as Simd>::f32s; 3];
/// A quaternion x, y, z, w in every lane.
pub(super) type Q<S> = [<S as Simd>::f32s; 4];

#[inline(always)]
pub(super) fn sub<S: Simd>([ax, ay, az]: V3<S>, [bx, by, bz]: V3<S>) -> V3<S> {
    [ax - bx, ay - by, az - bz]
}

/// `a + b k`.
#[inline(always)]
pub(super) fn add_scaled<S: Simd>(a: V3<S>, b: V3<S>, k: S::f32s) -> V3<S> {
    let ([ax, ay, az], [bx, by, bz]) = (a, b);
    [bx.mul_add(k, ax), by.mul_add(k, ay), bz.mul_add(k, az)]
}

#[inline(always)]
pub(super) fn squared_length<S: Simd>([x, y, z]: V3<S>) -> S::f32s {
    z.mul_add(z, y.mul_add(y, x * x))
}

#[inline(always)]
fn cross<S: Simd>([ax, ay, az]: V3<S>, [bx, by, bz]: V3<S>) -> V3<S> {
    [
        ay.mul_sub(bz, az * by),
        az.mul_sub(bx, ax * bz),
        ax.mul_sub(by, ay * bx),
    ]
}

/// `v` at length 1, or what `instead` gives where it has none.
#[inline(always)]
fn normalised_or<S: Simd>(simd: S, v: V3<S>, instead: impl FnOnce() -> V3<S>) -> V3<S> {
    let inverse = S::f32s::splat(simd, 1.0) / squared_length::<S>(v).sqrt();
    let sound = inverse.is_finite() & inverse.simd_gt(0.0);
    let [x, y, z] = v;
    let (x, y, z) = (x * inverse, y * inverse, z * inverse);
    if sound.all_true() {
        return [x, y, z];
    }
    let [ix, iy, iz] = instead();
    [
        sound.select(x, ix),
        sound.select(y, iy),
        sound.select(z, iz),
    ]
}

/// A vector at right angles to `v` of length 1 (Duff et al., "Building an Orthonormal Basis, Revisited").
#[inline(always)]
fn orthonormal<S: Simd>(simd: S, [x, y, z]: V3<S>) -> V3<S> {
    let sign = S::f32s::splat(simd, 1.0).copysign(z);
    let a = S::f32s::splat(simd, -1.0) / (sign + z);
    [x * y * a, sign + y * y * a, -y]
}

/// The frame of triangles whose second and third corners lie at `ab` and `ac` from the first: its axes x, y, z.
#[inline(always)]
pub(super) fn triangle_frame<S: Simd>(simd: S, ab: V3<S>, ac: V3<S>) -> [V3<S>; 3] {
    let x = normalised_or(
        simd,
        ab,
        #[inline(always)]
        || {
            let zero = S::f32s::splat(simd, 0.0);
            [S::f32s::splat(simd, 1.0), zero, zero]
        },
    );
    let z = normalised_or(
        simd,
        cross::<S>(x, ac),
        #[inline(always)]
        || orthonormal(simd, x),
    );
    [x, cross::<S>(z, x), z]
}

/// The quaternion of an orthonormal frame, of a length between 2 and 4: the caller normalises its product
/// (Mike Day, "Converting a Rotation Matrix to a Quaternion").
#[inline(always)]
pub(super) fn frame_quaternion<S: Simd>(
    simd: S,
    [[m00, m01, m02], [m10, m11, m12], [m20, m21, m22]]: [V3<S>; 3],
) -> Q<S> {
    let one = S::f32s::splat(simd, 1.0);
    let (difference, sum) = (m11 - m00, m11 + m00);
    let low = m22.simd_le(0.0);
    let is_x = low & difference.simd_le(0.0);
    let is_z = !low & sum.simd_le(0.0);
    let (xy, xz, yz) = (m01 + m10, m02 + m20, m12 + m21);
    let (wx, wy, wz) = (m12 - m21, m20 - m02, m01 - m10);
    let (minus, plus) = (one - m22, one + m22);
    [
        is_x.select(minus - difference, low.select(xy, is_z.select(xz, wx))),
        is_x.select(xy, low.select(minus + difference, is_z.select(yz, wy))),
        is_x.select(xz, low.select(yz, is_z.select(plus - sum, wz))),
        is_x.select(wx, low.select(wy, is_z.select(wz, plus + sum))),
    ]
}

/// `a b` at length 1.
#[inline(always)]
pub(super) fn turned<S: Simd>(simd: S, a: Q<S>, b: Q<S>) -> Q<S> {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    let x = aw.mul_add(bx, ax.mul_add(bw, ay.mul_sub(bz, az * by)));
    let y = aw.mul_add(by, ay.mul_add(bw, az.mul_sub(bx, ax * bz)));
    let z = aw.mul_add(bz, az.mul_add(bw, ax.mul_sub(by, ay * bx)));
    let w = aw.mul_sub(bw, ax.mul_add(bx, ay.mul_add(by, az * bz)));
    let length = w.mul_add(w, z.mul_add(z, y.mul_add(y, x * x)));
    let inverse = S::f32s::splat(simd, 1.0) / length.sqrt();
    [x * inverse, y * inverse, z * inverse, w * inverse]
}
