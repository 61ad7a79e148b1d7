//! From the moments of splats to the derivatives by the attributes and by the camera's pose.
//!
//! With d the way from a splat's mean to a pixel, q = d^T Q d, Q the inverse of the image covariance, and h the derivative by the
//! logarithm of alpha = o exp(-q / 2): the derivative by the mean is Q sum(h d), by the covariance Q sum(h d d^T) Q / 2, by the
//! logarithm of o sum(h). From there on it is the chain rule through `seen.rs`, backwards. A rotation's derivative is taken by a
//! rotation vector in the world, which follows from the rows of J W alone, since turning the Gaussian is turning them the other way.

use super::seen::{Seen, see};
use super::splat::{MOMENTS, Moments};
use crate::attributes::ATTRIBUTES;
use crate::vector::{Eight, LANES, Three, add_to, cross, dot, dot_same, mixed, three};
use crate::view::{Lens, Twist};
use fearless_simd::{f32x8, mask32x8, prelude::*};

/// The moments of a Gaussian that was not drawn.
const NOTHING: Moments = [0.0; MOMENTS];

/// Adds the derivatives by the attributes of Gaussians `start..` to `out`, planes of their part, and returns the derivatives by the
/// camera's motion. `moments_of` says what a Gaussian's splat gathered; nothing where it was not drawn.
#[inline(always)]
pub(crate) fn pull_back<'a, S: Simd>(
    simd: S,
    lens: &Lens,
    planes: &[&[f32]; ATTRIBUTES],
    start: usize,
    moments_of: impl Fn(usize) -> Option<&'a Moments>,
    out: &mut [&mut [f32]; ATTRIBUTES],
) -> Twist {
    let none = f32x8::splat(simd, 0.0);
    let mut motion = [none; 6];
    let count = out[0].len();
    for at in (0..count).step_by(LANES) {
        let mut drawn = 0;
        let mut lanes = [[0.0; LANES]; MOMENTS];
        for lane in 0..LANES.min(count - at) {
            let moments = moments_of(start + at + lane);
            drawn |= u64::from(moments.is_some()) << lane;
            for (lanes, moment) in lanes.iter_mut().zip(moments.unwrap_or(&NOTHING)) {
                lanes[lane] = *moment;
            }
        }
        if drawn == 0 {
            continue;
        }
        let drawn = mask32x8::from_bitmask(simd, drawn);
        let seen = see(simd, lens, planes, start + at);
        let mut moments = [none; MOMENTS];
        for (moments, lanes) in moments.iter_mut().zip(lanes) {
            *moments = f32x8::load_array(simd, lanes);
        }
        let (by_attribute, by_motion) = chain(lens, &seen, &moments, none);
        for (out, derivative) in out.iter_mut().zip(by_attribute) {
            add_to(simd, out, at, drawn.select(derivative, none));
        }
        for (sum, derivative) in motion.iter_mut().zip(by_motion) {
            *sum += drawn.select(derivative, none);
        }
    }
    let mut twist = [0.0; 6];
    for (twist, lanes) in twist.iter_mut().zip(motion) {
        for lane in lanes.to_array() {
            *twist += f64::from(lane);
        }
    }
    twist
}

/// The derivatives by 14 attributes and by the camera's motion.
#[inline(always)]
fn chain<S: Simd>(
    lens: &Lens,
    seen: &Seen<S>,
    moments: &[Eight<S>; MOMENTS],
    none: Eight<S>,
) -> ([Eight<S>; ATTRIBUTES], [Eight<S>; 6]) {
    let [h, hx, hxx, hy, hxy, hyy, red, green, blue] = *moments;
    let [a, b, c] = seen.covariance;
    let inverse = 1.0 / seen.determinant;
    // Q = [[a, b], [b, c]]^-1.
    let (qa, qb, qc) = (c * inverse, b * inverse * -1.0, a * inverse);
    let by_mean = [qa * hx + qb * hy, qb * hx + qc * hy];
    // Q M Q: the derivative by the covariance, twice.
    let (n00, n01) = (qa * hxx + qb * hxy, qa * hxy + qb * hyy);
    let (n10, n11) = (qb * hxx + qc * hxy, qb * hxy + qc * hyy);
    let (by_a, by_b, by_c) = (
        n00 * qa + n01 * qb,
        n00 * qb + n01 * qc,
        n10 * qb + n11 * qc,
    );

    // covariance = root root^T.
    let by_root = [
        mixed(&seen.root[0], by_a, &seen.root[1], by_b),
        mixed(&seen.root[0], by_b, &seen.root[1], by_c),
    ];
    let by_log_scale =
        three!(k => by_root[0][k] * seen.root[0][k] + by_root[1][k] * seen.root[1][k]);
    // root = image_from_world R S.
    let by_image = [along_own(seen, &by_root[0]), along_own(seen, &by_root[1])];
    let first = cross(&by_image[0], &seen.image_from_world[0]);
    let second = cross(&by_image[1], &seen.image_from_world[1]);
    let by_turn = three!(k => first[k] + second[k]);

    // image_from_world = focal / z (axis - slope z_axis), mean = focal place / z + centre.
    let mut by_place = [none; 3];
    let mut by_inverse_depth = none;
    for axis in 0..2 {
        let focal = lens.focal[axis];
        let along = dot(&by_image[axis], &seen.axes[axis]);
        let by_slope = dot_same(&by_image[axis], lens.rows[2]) * seen.inverse_depth * -1.0;
        let by_slope = seen.free[axis].select(by_slope, none);
        let by_ratio = (by_mean[axis] + by_slope) * focal;
        by_place[axis] = by_ratio * seen.inverse_depth;
        by_inverse_depth += along * focal + by_ratio * seen.place[axis];
    }
    by_place[2] = by_inverse_depth * seen.inverse_depth * seen.inverse_depth * -1.0;

    let rows = &lens.rows;
    let by_position =
        three!(k => by_place[0] * rows[0][k] + by_place[1] * rows[1][k] + by_place[2] * rows[2][k]);
    // A unit quaternion q changes by (turn / 2, 0) q.
    let [x, y, z, w] = seen.rotation;
    let twice = seen.inverse_length * 2.0;
    let around = cross(&by_turn, &[x, y, z]);
    let by_rotation = [
        (by_turn[0] * w + around[0]) * twice,
        (by_turn[1] * w + around[1]) * twice,
        (by_turn[2] * w + around[2]) * twice,
        dot(&by_turn, &[x, y, z]) * twice * -1.0,
    ];
    let by_logit = h * seen.transparency;
    let [red, green, blue] = [
        lit(seen.colour[0], red, none),
        lit(seen.colour[1], green, none),
        lit(seen.colour[2], blue, none),
    ];

    // Turning what the camera sees moves every place and turns every Gaussian.
    let swung = cross(&seen.place, &by_place);
    let turned = three!(k => swung[k] + dot_same(&by_turn, rows[k]));
    let [p0, p1, p2] = by_position;
    let [r0, r1, r2, r3] = by_rotation;
    let [s0, s1, s2] = by_log_scale;
    (
        [
            p0, p1, p2, r0, r1, r2, r3, s0, s1, s2, by_logit, red, green, blue,
        ],
        [
            by_place[0],
            by_place[1],
            by_place[2],
            turned[0],
            turned[1],
            turned[2],
        ],
    )
}

/// R S v: the derivative by a row of J W, of that by the row's product with R S.
#[inline(always)]
fn along_own<S: Simd>(seen: &Seen<S>, row: &Three<S>) -> Three<S> {
    let scaled = three!(k => row[k] * seen.scale[k]);
    let [x, y, z] = &seen.own_axes;
    three!(k => x[k] * scaled[0] + y[k] * scaled[1] + z[k] * scaled[2])
}

/// A colour's derivative: none where it is held at 0.
#[inline(always)]
fn lit<S: Simd>(colour: Eight<S>, derivative: Eight<S>, none: Eight<S>) -> Eight<S> {
    colour.simd_gt(0.0).select(derivative, none)
}
