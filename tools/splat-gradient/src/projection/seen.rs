//! Eight Gaussians as a view sees them, with everything that the derivatives need again.

use crate::attributes::{ATTRIBUTES, plane};
use crate::vector::{Eight, Three, cross, dot, dot_same, exp2, load, three};
use crate::view::{Lens, NEAR};
use fearless_simd::{f32x8, mask32x8, prelude::*};
use std::f32::consts::LOG2_E;

/// 3DGS widens every splat by 0.3 px^2.
const LOW_PASS: f32 = 0.3;
/// No scale is as large: ln 256, as the renderer has it.
const LOG_SCALE_END: f32 = 5.545_177_4;
/// No shorter quaternion says a rotation; its square.
const LEAST_LENGTH_2: f32 = 1e-24;

/// Lanes whose Gaussian is not [`Self::sound`] hold anything.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<S: Simd> {
    /// All numbers are finite, and the centre is before the near plane.
    pub(super) sound: mask32x8<S>,
    /// The centre in the camera's axes, metres.
    pub(super) place: Three<S>,
    pub(super) inverse_depth: Eight<S>,
    /// Whether x / z and y / z are taken as they are, and not held at the Jacobian's limits.
    pub(super) free: [mask32x8<S>; 2],
    /// The camera's x and y axes, each less its slope times the z axis, in the world.
    pub(super) axes: [Three<S>; 2],
    /// Rows of J W: the image's two directions, in the world, pixels per metre.
    pub(super) image_from_world: [Three<S>; 2],
    /// The unit quaternion x, y, z, w, and 1 / the length that it had.
    pub(super) rotation: [Eight<S>; 4],
    pub(super) inverse_length: Eight<S>,
    /// Columns of R: the Gaussian's own axes in the world.
    pub(super) own_axes: [Three<S>; 3],
    /// Standard deviations, metres.
    pub(super) scale: Three<S>,
    /// Rows of J W R S, pixels.
    pub(super) root: [Three<S>; 2],
    /// a, b, c of the image covariance [[a, b], [b, c]], widened, px^2; and its determinant.
    pub(super) covariance: [Eight<S>; 3],
    pub(super) determinant: Eight<S>,
    /// 0..=1, and 1 less it.
    pub(super) opacity: Eight<S>,
    pub(super) transparency: Eight<S>,
    /// Display values, as they are.
    pub(super) colour: Three<S>,
}

/// The Gaussians from `at` on; those past the last are not sound.
#[inline(always)]
pub(super) fn see<S: Simd>(
    simd: S,
    lens: &Lens,
    planes: &[&[f32]; ATTRIBUTES],
    at: usize,
) -> Seen<S> {
    let position = three!(k => load(simd, planes[plane::POSITION.start + k], at));
    let log_scale = three!(k => load(simd, planes[plane::LOG_SCALE.start + k], at));
    let colour = three!(k => load(simd, planes[plane::COLOUR.start + k], at));
    let logit = load(simd, planes[plane::OPACITY], at);
    let first = plane::ROTATION.start;
    let raw = [
        load(simd, planes[first], at),
        load(simd, planes[first + 1], at),
        load(simd, planes[first + 2], at),
        load(simd, planes[first + 3], at),
    ];

    let place = [
        dot_same(&position, lens.rows[0]) + lens.shift[0],
        dot_same(&position, lens.rows[1]) + lens.shift[1],
        dot_same(&position, lens.rows[2]) + lens.shift[2],
    ];
    let inverse_depth = 1.0 / place[2];
    let (slope_x, free_x) = held(place[0] * inverse_depth, lens, 0);
    let (slope_y, free_y) = held(place[1] * inverse_depth, lens, 1);
    let axes = [
        less_depth(simd, lens, 0, slope_x),
        less_depth(simd, lens, 1, slope_y),
    ];
    let image_from_world = [
        scaled(&axes[0], inverse_depth * lens.focal[0]),
        scaled(&axes[1], inverse_depth * lens.focal[1]),
    ];

    let length_2 = raw[3].mul_add(
        raw[3],
        dot(&[raw[0], raw[1], raw[2]], &[raw[0], raw[1], raw[2]]),
    );
    let inverse_length = 1.0 / length_2.sqrt();
    let rotation = [
        raw[0] * inverse_length,
        raw[1] * inverse_length,
        raw[2] * inverse_length,
        raw[3] * inverse_length,
    ];
    let own_axes = columns(simd, &rotation);
    let scale = three!(k => exp2(simd, in_range(log_scale[k] * LOG2_E)));
    let [along_x, along_y] = &image_from_world;
    let root = [
        three!(k => dot(along_x, &own_axes[k]) * scale[k]),
        three!(k => dot(along_y, &own_axes[k]) * scale[k]),
    ];
    let (a, b, c) = (
        dot(&root[0], &root[0]),
        dot(&root[0], &root[1]),
        dot(&root[1], &root[1]),
    );
    // Cauchy-Binet instead of a c - b b, which cancels for thin splats.
    let minors = cross(&root[0], &root[1]);
    let determinant = dot(&minors, &minors) + (a + c) * LOW_PASS + LOW_PASS * LOW_PASS;

    // The sigmoid, and its complement without cancellation.
    let against = exp2(simd, in_range(logit * -LOG2_E));
    let opacity = 1.0 / (against + 1.0);

    // Sums of anything that is not finite are not finite: one test for all.
    let sum =
        position[0] + position[1] + position[2] + length_2 + colour[0] + colour[1] + colour[2];
    let sound = sum.is_finite()
        & place[2].simd_gt(NEAR)
        & length_2.simd_gt(LEAST_LENGTH_2)
        & log_scale[0].simd_lt(LOG_SCALE_END)
        & log_scale[1].simd_lt(LOG_SCALE_END)
        & log_scale[2].simd_lt(LOG_SCALE_END)
        & !logit.is_nan();
    Seen {
        sound,
        place,
        inverse_depth,
        free: [free_x, free_y],
        axes,
        image_from_world,
        rotation,
        inverse_length,
        own_axes,
        scale,
        root,
        covariance: [a + LOW_PASS, b, c + LOW_PASS],
        determinant,
        opacity,
        transparency: against * opacity,
        colour,
    }
}

/// A slope within the Jacobian's limits, and whether it was.
#[inline(always)]
fn held<S: Simd>(slope: Eight<S>, lens: &Lens, axis: usize) -> (Eight<S>, mask32x8<S>) {
    let (least, most) = (lens.least_slope[axis], lens.most_slope[axis]);
    let free = slope.simd_ge(least) & slope.simd_le(most);
    (slope.max(least).min(most), free)
}

/// A camera's axis less `slope` times its z axis.
#[inline(always)]
fn less_depth<S: Simd>(simd: S, lens: &Lens, axis: usize, slope: Eight<S>) -> Three<S> {
    let (row, depth) = (lens.rows[axis], lens.rows[2]);
    three!(k => f32x8::splat(simd, row[k]) - slope * depth[k])
}

#[inline(always)]
fn scaled<S: Simd>(vector: &Three<S>, by: Eight<S>) -> Three<S> {
    [vector[0] * by, vector[1] * by, vector[2] * by]
}

/// The columns of a unit quaternion's matrix.
#[inline(always)]
fn columns<S: Simd>(simd: S, [x, y, z, w]: &[Eight<S>; 4]) -> [Three<S>; 3] {
    let one = f32x8::splat(simd, 1.0);
    let (x, y, z, w) = (*x, *y, *z, *w);
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xx, yy, zz) = (x * x2, y * y2, z * z2);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    [
        [one - (yy + zz), xy + wz, xz - wy],
        [xy - wz, one - (xx + zz), yz + wx],
        [xz + wy, yz - wx, one - (xx + yy)],
    ]
}

/// Held where 2^x is a normal number.
#[inline(always)]
fn in_range<S: Simd>(x: Eight<S>) -> Eight<S> {
    x.max(-126.0).min(126.0)
}
