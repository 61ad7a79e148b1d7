//! F_m2g (paper, section IV-B): Gaussians in their triangles' frames -> Gaussians in the world, and the derivatives.
//!
//! As `spmm3::BoundGaussians::pose`. A frame stays orthonormal, so that all that acts on it is a torque: of the offset, and of the rotation.
//! With x along the edge e = b - a, n the normal, y = n cross x, f = c - a, the frame turns by
//! w_n = y.de / |e|, w_y = -n.de / |e| and w_x = (n.df - (f.x / |e|) n.de) / (f.y), from which the derivatives by the corners follow.

use crate::planes::{for_each_run, planes, planes_mut};
use crate::vector::{
    Eight, Four, LANES, Three, add, add_scaled, conjugate, cross, dot, dot_four, gather, load,
    product, scaled, scaled_four, store, sub,
};
use fearless_simd::{Level, dispatch, f32x8, prelude::*};
use spmm3::{ATTRIBUTES, BoundGaussians, SH_C0, attribute};

/// An edge or height of a triangle that is shorter, metres, does not turn the frame: its derivatives would be no use.
const LEAST_EDGE: f32 = 1e-5;
/// A quaternion whose length squared is less says no rotation, as in `spmm3`.
const LEAST_ROTATION: f32 = 1e-12;
/// Derivatives by the coordinates of three corners.
pub(crate) const CORNERS: usize = 9;

/// Where Gaussians are bound.
#[derive(Debug, Clone)]
pub(crate) struct Binding {
    /// Vertices of the triangles.
    corners: [Vec<u32>; 3],
    /// Weights of the second and third corner.
    barycentrics: [Vec<f32>; 2],
}

impl Binding {
    pub(crate) fn new(gaussians: &BoundGaussians) -> Self {
        Self {
            corners: [0, 1, 2].map(|k| gaussians.corners().iter().map(|c| c[k]).collect()),
            barycentrics: [0, 1].map(|k| gaussians.barycentrics().iter().map(|b| b[k]).collect()),
        }
    }

    /// World Gaussians, row-major [14, N_g], of posed vertices ([3, N_v], world) and attributes in the triangles' frames.
    pub(crate) fn forward(&self, level: Level, vertices: &[f32], local: &[f32], world: &mut [f32]) {
        let (vertices, local) = (planes(vertices), planes(local));
        for_each_run(planes_mut::<ATTRIBUTES>(world), &|start, mut out| {
            dispatch!(level, simd => self.forward_run(simd, &vertices, &local, start, &mut out));
        });
    }

    #[inline(always)]
    fn forward_run<S: Simd>(
        &self,
        simd: S,
        vertices: &[&[f32]; 3],
        local: &[&[f32]; ATTRIBUTES],
        start: usize,
        out: &mut [&mut [f32]; ATTRIBUTES],
    ) {
        for at in (0..out[0].len()).step_by(LANES) {
            let seat = self.seat(simd, vertices, start + at);
            let local = Local::load(simd, local, start + at);
            let [x, y, n] = &seat.frame.axes;
            let place = add_scaled(&seat.anchor, x, local.offset[0]);
            let place = add_scaled(&place, y, local.offset[1]);
            let place = add_scaled(&place, n, local.offset[2]);
            let turned = product(&seat.frame.quaternion, &local.rotation);
            let [qx, qy, qz, qw] = scaled_four(&turned, 1.0 / dot_four(&turned, &turned).sqrt());
            let [sx, sy, sz] = local.log_scale;
            let [r, g, b] = local.colour;
            let [px, py, pz] = place;
            let world = [
                px,
                py,
                pz,
                qx,
                qy,
                qz,
                qw,
                sx,
                sy,
                sz,
                local.opacity,
                r * SH_C0 + 0.5,
                g * SH_C0 + 0.5,
                b * SH_C0 + 0.5,
            ];
            for (out, numbers) in out.iter_mut().zip(world) {
                store(out, at, numbers);
            }
        }
    }

    /// From derivatives by the world Gaussians to those by the attributes in the triangles' frames (`by_local`, [14, N_g], written) and by
    /// the corners (`by_corners`, row-major [3, 3, N_g]: corner, coordinate; written).
    pub(crate) fn backward(
        &self,
        level: Level,
        vertices: &[f32],
        local: &[f32],
        by_world: &[f32],
        by_local: &mut [f32],
        by_corners: &mut [f32],
    ) {
        let (vertices, local, by_world) = (planes(vertices), planes(local), planes(by_world));
        let by_local: [&mut [f32]; ATTRIBUTES] = planes_mut(by_local);
        let by_corners: [&mut [f32]; CORNERS] = planes_mut(by_corners);
        let (mut by_local, mut by_corners) = (by_local.into_iter(), by_corners.into_iter());
        let out: [&mut [f32]; ATTRIBUTES + CORNERS] = std::array::from_fn(|_| {
            let next = by_local.next().or_else(|| by_corners.next());
            next.unwrap_or_default()
        });
        for_each_run(out, &|start, mut out| {
            dispatch!(level, simd => self.backward_run(simd, &vertices, &local, &by_world, start, &mut out));
        });
    }

    #[inline(always)]
    fn backward_run<S: Simd>(
        &self,
        simd: S,
        vertices: &[&[f32]; 3],
        local: &[&[f32]; ATTRIBUTES],
        by_world: &[&[f32]; ATTRIBUTES],
        start: usize,
        out: &mut [&mut [f32]; ATTRIBUTES + CORNERS],
    ) {
        let none = f32x8::splat(simd, 0.0);
        for at in (0..out[0].len()).step_by(LANES) {
            let seat = self.seat(simd, vertices, start + at);
            let local = Local::load(simd, local, start + at);
            let mut by = [none; ATTRIBUTES];
            for (by, plane) in by.iter_mut().zip(by_world) {
                *by = load(simd, plane, start + at);
            }
            let by_place = [by[0], by[1], by[2]];
            let by_turned = [by[3], by[4], by[5], by[6]];
            let frame = &seat.frame;
            let [x, y, n] = &frame.axes;

            let by_offset = [dot(x, &by_place), dot(y, &by_place), dot(n, &by_place)];
            let turned = product(&frame.quaternion, &local.rotation);
            let by_unit = product(&conjugate(&frame.quaternion), &by_turned);
            let along = dot_four(&by_unit, &local.rotation);
            let q = &local.rotation;
            let by_rotation = [
                (by_unit[0] - q[0] * along) * local.inverse_length,
                (by_unit[1] - q[1] * along) * local.inverse_length,
                (by_unit[2] - q[2] * along) * local.inverse_length,
                (by_unit[3] - q[3] * along) * local.inverse_length,
            ];

            // What turns the frame about its axes. A unit quaternion q changes by (turn / 2, 0) q.
            let axis = [turned[0], turned[1], turned[2]];
            let by_axis = [by_turned[0], by_turned[1], by_turned[2]];
            let around = cross(&axis, &by_axis);
            let half = f32x8::splat(simd, 0.5);
            let of_rotation = [
                (by_axis[0] * turned[3] + around[0] - axis[0] * by_turned[3]) * half,
                (by_axis[1] * turned[3] + around[1] - axis[1] * by_turned[3]) * half,
                (by_axis[2] * turned[3] + around[2] - axis[2] * by_turned[3]) * half,
            ];
            let arm = &local.offset;
            let of_offset = cross(arm, &by_offset);
            let torque = [
                dot(&of_rotation, x) + of_offset[0],
                dot(&of_rotation, y) + of_offset[1],
                dot(&of_rotation, n) + of_offset[2],
            ];
            let lean = torque[0] * frame.inverse_height;
            let swing =
                (torque[0] * frame.along * frame.inverse_height + torque[1]) * frame.inverse_edge;
            let by_ab = add_scaled(&scaled(y, torque[2] * frame.inverse_edge), n, swing * -1.0);
            let by_ac = scaled(n, lean);
            let [v, w] = seat.barycentrics;
            let by_b = add_scaled(&by_ab, &by_place, v);
            let by_c = add_scaled(&by_ac, &by_place, w);
            let by_a = sub(&by_place, &add(&by_b, &by_c));

            let derivatives = [
                by_offset[0],
                by_offset[1],
                by_offset[2],
                local.sound.select(by_rotation[0], none),
                local.sound.select(by_rotation[1], none),
                local.sound.select(by_rotation[2], none),
                local.sound.select(by_rotation[3], none),
                by[7],
                by[8],
                by[9],
                by[10],
                by[11] * SH_C0,
                by[12] * SH_C0,
                by[13] * SH_C0,
                by_a[0],
                by_a[1],
                by_a[2],
                by_b[0],
                by_b[1],
                by_b[2],
                by_c[0],
                by_c[1],
                by_c[2],
            ];
            for (out, numbers) in out.iter_mut().zip(derivatives) {
                store(out, at, numbers);
            }
        }
    }

    /// The triangles of the Gaussians from `at` on.
    #[inline(always)]
    fn seat<S: Simd>(&self, simd: S, vertices: &[&[f32]; 3], at: usize) -> Seat<S> {
        let [a, b, c] = [
            self.corner(simd, vertices, 0, at),
            self.corner(simd, vertices, 1, at),
            self.corner(simd, vertices, 2, at),
        ];
        let barycentrics = [
            load(simd, &self.barycentrics[0], at),
            load(simd, &self.barycentrics[1], at),
        ];
        let (ab, ac) = (sub(&b, &a), sub(&c, &a));
        let anchor = add_scaled(&a, &ab, barycentrics[0]);
        Seat {
            anchor: add_scaled(&anchor, &ac, barycentrics[1]),
            barycentrics,
            frame: Frame::new(simd, &ab, &ac),
        }
    }

    #[inline(always)]
    fn corner<S: Simd>(&self, simd: S, vertices: &[&[f32]; 3], k: usize, at: usize) -> Three<S> {
        let indices = &self.corners[k];
        [
            gather(simd, vertices[0], indices, at),
            gather(simd, vertices[1], indices, at),
            gather(simd, vertices[2], indices, at),
        ]
    }

    /// Adds the derivatives by the corners to those by the vertices ([3, N_v]), in the order of the Gaussians.
    pub(crate) fn scatter(&self, by_corners: &[f32], by_vertices: &mut [f32]) {
        let by_corners: [&[f32]; CORNERS] = planes(by_corners);
        let [x, y, z] = planes_mut::<3>(by_vertices);
        let add = |axis: usize, sums: &mut [f32]| {
            for (k, corners) in self.corners.iter().enumerate() {
                for (vertex, by) in corners.iter().zip(by_corners[3 * k + axis]) {
                    sums[*vertex as usize] += by;
                }
            }
        };
        rayon::join(|| add(0, x), || rayon::join(|| add(1, y), || add(2, z)));
    }
}

/// Eight Gaussians' triangles.
struct Seat<S: Simd> {
    /// The barycentric point.
    anchor: Three<S>,
    barycentrics: [Eight<S>; 2],
    frame: Frame<S>,
}

/// Eight triangles' own frames.
struct Frame<S: Simd> {
    /// World directions of the frame's x, y and z.
    axes: [Three<S>; 3],
    /// The same as a unit quaternion.
    quaternion: Four<S>,
    /// 1 / |b - a| and 1 / the height of c over it; 0 where either is too short to turn the frame.
    inverse_edge: Eight<S>,
    inverse_height: Eight<S>,
    /// How far c lies along the edge, metres.
    along: Eight<S>,
}

impl<S: Simd> Frame<S> {
    /// Of triangles whose second and third corners lie at `ab` and `ac` from the first; some orthonormal frame where they collapse.
    #[inline(always)]
    fn new(simd: S, ab: &Three<S>, ac: &Three<S>) -> Self {
        let (one, none) = (f32x8::splat(simd, 1.0), f32x8::splat(simd, 0.0));
        let inverse_edge = 1.0 / dot(ab, ab).sqrt();
        let sound = inverse_edge.is_finite() & inverse_edge.simd_gt(0.0);
        let x = [
            sound.select(ab[0] * inverse_edge, one),
            sound.select(ab[1] * inverse_edge, none),
            sound.select(ab[2] * inverse_edge, none),
        ];
        let up = cross(&x, ac);
        let inverse_height = 1.0 / dot(&up, &up).sqrt();
        let sound = inverse_height.is_finite() & inverse_height.simd_gt(0.0);
        // Duff et al., "Building an Orthonormal Basis, Revisited".
        let sign = one.copysign(x[2]);
        let a = -1.0 / (sign + x[2]);
        let n = [
            sound.select(up[0] * inverse_height, x[0] * x[1] * a),
            sound.select(up[1] * inverse_height, sign + x[1] * x[1] * a),
            sound.select(up[2] * inverse_height, x[1] * -1.0),
        ];
        let y = cross(&n, &x);
        let free =
            inverse_edge.simd_le(1.0 / LEAST_EDGE) & inverse_height.simd_le(1.0 / LEAST_EDGE);
        let quaternion = frame_quaternion(simd, &x, &y, &n);
        let length = 1.0 / dot_four(&quaternion, &quaternion).sqrt();
        Self {
            along: dot(ac, &x),
            axes: [x, y, n],
            quaternion: scaled_four(&quaternion, length),
            inverse_edge: free.select(inverse_edge, none),
            inverse_height: free.select(inverse_height, none),
        }
    }
}

/// The quaternion of an orthonormal frame, of a length between 2 and 4 (Mike Day, "Converting a Rotation Matrix to a Quaternion").
#[inline(always)]
fn frame_quaternion<S: Simd>(
    simd: S,
    [m00, m01, m02]: &Three<S>,
    [m10, m11, m12]: &Three<S>,
    [m20, m21, m22]: &Three<S>,
) -> Four<S> {
    let one = f32x8::splat(simd, 1.0);
    let (difference, sum) = (*m11 - *m00, *m11 + *m00);
    let low = m22.simd_le(0.0);
    let is_x = low & difference.simd_le(0.0);
    let is_z = !low & sum.simd_le(0.0);
    let (xy, xz, yz) = (*m01 + *m10, *m02 + *m20, *m12 + *m21);
    let (wx, wy, wz) = (*m12 - *m21, *m20 - *m02, *m01 - *m10);
    let (minus, plus) = (one - *m22, one + *m22);
    [
        is_x.select(minus - difference, low.select(xy, is_z.select(xz, wx))),
        is_x.select(xy, low.select(minus + difference, is_z.select(yz, wy))),
        is_x.select(xz, low.select(yz, is_z.select(plus - sum, wz))),
        is_x.select(wx, low.select(wy, is_z.select(wz, plus + sum))),
    ]
}

/// Eight Gaussians in their triangles' frames.
struct Local<S: Simd> {
    offset: Three<S>,
    /// At length 1; the identity where there is none.
    rotation: Four<S>,
    sound: fearless_simd::mask32x8<S>,
    inverse_length: Eight<S>,
    log_scale: Three<S>,
    opacity: Eight<S>,
    colour: Three<S>,
}

impl<S: Simd> Local<S> {
    #[inline(always)]
    fn load(simd: S, planes: &[&[f32]; ATTRIBUTES], at: usize) -> Self {
        let (one, none) = (f32x8::splat(simd, 1.0), f32x8::splat(simd, 0.0));
        let offset = attribute::OFFSET.start;
        let turn = attribute::ROTATION.start;
        let scale = attribute::LOG_SCALE.start;
        let colour = attribute::COLOUR.start;
        let raw = [
            load(simd, planes[turn], at),
            load(simd, planes[turn + 1], at),
            load(simd, planes[turn + 2], at),
            load(simd, planes[turn + 3], at),
        ];
        let square = dot_four(&raw, &raw);
        let sound = square.simd_gt(LEAST_ROTATION);
        let inverse_length = 1.0 / square.sqrt();
        Self {
            offset: [
                load(simd, planes[offset], at),
                load(simd, planes[offset + 1], at),
                load(simd, planes[offset + 2], at),
            ],
            rotation: [
                sound.select(raw[0] * inverse_length, none),
                sound.select(raw[1] * inverse_length, none),
                sound.select(raw[2] * inverse_length, none),
                sound.select(raw[3] * inverse_length, one),
            ],
            sound,
            inverse_length,
            log_scale: [
                load(simd, planes[scale], at),
                load(simd, planes[scale + 1], at),
                load(simd, planes[scale + 2], at),
            ],
            opacity: load(simd, planes[attribute::OPACITY], at),
            colour: [
                load(simd, planes[colour], at),
                load(simd, planes[colour + 1], at),
                load(simd, planes[colour + 2], at),
            ],
        }
    }
}
