//! F_m2g on the CPU: posed vertices and a block's residuals -> 14 planes of a state, activated.
//!
//! As `spmm3::BoundGaussians::pose` (paper, section IV-B), and then what the renderer needs: the opacity through the
//! sigmoid, scales as logarithms of base 2, colours as they are shown.

use super::frame::{V3, add_scaled, frame_quaternion, squared_length, sub, triangle_frame, turned};
use super::tail::Residuals;
use super::{BLOCK, Sixteen};
use crate::state::{STATE_PLANES, StateChange, StateSlice, plane};
use fearless_simd::prelude::*;
use glam::Vec3;
use spmm3::{ATTRIBUTES, BoundGaussians, SH_C0, attribute};
use std::f32::consts::LOG2_E;
use std::ops::Range;

/// The tables of F_m2g for 16 Gaussians.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Bound {
    attributes: [Sixteen; ATTRIBUTES],
    barycentrics: [Sixteen; 2],
    corners: [[u32; BLOCK]; 3],
}

/// The posed mesh of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mesh<'a> {
    /// Three planes of vertices, metres.
    pub(super) planes: [&'a [f32]; 3],
    /// Root translation, metres.
    pub(super) root: Vec3,
}

impl Bound {
    /// All of an avatar's Gaussians, block after block; those past the last are bound to the first vertex.
    pub(super) fn blocks(gaussians: &BoundGaussians) -> Vec<Self> {
        let count = gaussians.len();
        let block = |start: usize| Self {
            attributes: std::array::from_fn(|plane| {
                let plane = &gaussians.attributes()[plane * count..][..count];
                std::array::from_fn(|lane| plane.get(start + lane).copied().unwrap_or(0.0))
            }),
            barycentrics: std::array::from_fn(|corner| {
                let all = gaussians.barycentrics();
                std::array::from_fn(|lane| all.get(start + lane).map_or(0.0, |b| b[corner]))
            }),
            corners: std::array::from_fn(|corner| {
                let all = gaussians.corners();
                std::array::from_fn(|lane| all.get(start + lane).map_or(0, |c| c[corner]))
            }),
        };
        (0..count).step_by(BLOCK).map(block).collect()
    }

    /// Poses the Gaussians `lanes` of this block into `out` and compares them with `previous`, the same Gaussians of
    /// another state.
    #[inline(always)]
    pub(super) fn pose<S: Simd>(
        &self,
        simd: S,
        mesh: &Mesh<'_>,
        residuals: &Residuals,
        lanes: Range<usize>,
        previous: Option<&[&[f32]; STATE_PLANES]>,
        out: &mut StateSlice<'_>,
    ) -> StateChange {
        let mut change = StateChange::default();
        for from in (0..BLOCK).step_by(S::f32s::LEN) {
            let wanted = lanes.start.max(from)..lanes.end.min(from + S::f32s::LEN);
            if wanted.is_empty() {
                continue;
            }
            let posed = self.pose_lanes(simd, mesh, residuals, from);
            let at = wanted.start - lanes.start;
            let mut before = posed;
            if wanted.len() == S::f32s::LEN {
                let there = at..at + S::f32s::LEN;
                if let Some(previous) = previous {
                    for (before, plane) in before.iter_mut().zip(previous) {
                        *before = S::f32s::from_slice(simd, &plane[there.clone()]);
                    }
                }
                for (out, posed) in out.0.iter_mut().zip(&posed) {
                    posed.store_slice(&mut out[there.clone()]);
                }
            } else {
                // Lanes outside the range count as unchanged.
                let part = wanted.start - from..wanted.end - from;
                let there = at..at + part.len();
                if let Some(previous) = previous {
                    for (before, plane) in before.iter_mut().zip(previous) {
                        before.as_mut_slice()[part.clone()].copy_from_slice(&plane[there.clone()]);
                    }
                }
                for (out, posed) in out.0.iter_mut().zip(&posed) {
                    out[there.clone()].copy_from_slice(&posed.as_slice()[part.clone()]);
                }
            }
            if previous.is_some() {
                change = change.join(compare(simd, &posed, &before));
            }
        }
        change
    }

    /// As many Gaussians as a vector holds, from `from` on.
    #[inline(always)]
    fn pose_lanes<S: Simd>(
        &self,
        simd: S,
        mesh: &Mesh<'_>,
        residuals: &Residuals,
        from: usize,
    ) -> [S::f32s; STATE_PLANES] {
        let a = self.corner(simd, mesh, 0, from);
        let b = self.corner(simd, mesh, 1, from);
        let c = self.corner(simd, mesh, 2, from);
        let (ab, ac) = (sub::<S>(b, a), sub::<S>(c, a));
        let frame = triangle_frame(simd, ab, ac);
        let [right, up, out] = frame;
        let [v, w] = &self.barycentrics;
        let anchor = add_scaled::<S>(
            add_scaled::<S>(a, ab, load(simd, v, from)),
            ac,
            load(simd, w, from),
        );

        // The template's attributes and the residuals, as one.
        let local = Local {
            template: &self.attributes,
            residuals,
            from,
        };
        let offset = attribute::OFFSET.start;
        let position = add_scaled::<S>(anchor, right, local.get(simd, offset));
        let position = add_scaled::<S>(position, up, local.get(simd, offset + 1));
        let [px, py, pz] = add_scaled::<S>(position, out, local.get(simd, offset + 2));

        // A sum of quaternions need not have unit length: the identity where it is zero.
        let turn = attribute::ROTATION.start;
        let (x, y) = (local.get(simd, turn), local.get(simd, turn + 1));
        let (z, w) = (local.get(simd, turn + 2), local.get(simd, turn + 3));
        let length = w.mul_add(w, squared_length::<S>([x, y, z]));
        let sound = length.simd_gt(1e-12);
        let none = S::f32s::splat(simd, 0.0);
        let turn = [
            sound.select(x, none),
            sound.select(y, none),
            sound.select(z, none),
            sound.select(w, S::f32s::splat(simd, 1.0)),
        ];
        let [x, y, z, w] = turned(simd, frame_quaternion(simd, frame), turn);
        let (scale, colour) = (attribute::LOG_SCALE.start, attribute::COLOUR.start);
        [
            px + mesh.root.x,
            py + mesh.root.y,
            pz + mesh.root.z,
            x,
            y,
            z,
            w,
            local.get(simd, scale) * LOG2_E,
            local.get(simd, scale + 1) * LOG2_E,
            local.get(simd, scale + 2) * LOG2_E,
            sigmoid(simd, local.get(simd, attribute::OPACITY)),
            local.get(simd, colour) * SH_C0 + 0.5,
            local.get(simd, colour + 1) * SH_C0 + 0.5,
            local.get(simd, colour + 2) * SH_C0 + 0.5,
        ]
    }

    /// The posed corners number `corner` of the triangles from `from` on.
    #[inline(always)]
    fn corner<S: Simd>(&self, simd: S, mesh: &Mesh<'_>, corner: usize, from: usize) -> V3<S> {
        let [x, y, z] = mesh.planes;
        let indices = &self.corners[corner][from..from + S::f32s::LEN];
        [
            gather(simd, x, indices),
            gather(simd, y, indices),
            gather(simd, z, indices),
        ]
    }
}

/// `plane` at each of `indices`.
#[inline(always)]
fn gather<S: Simd>(simd: S, plane: &[f32], indices: &[u32]) -> S::f32s {
    let mut numbers = [0.0; BLOCK];
    for (number, index) in numbers.iter_mut().zip(indices) {
        *number = plane[*index as usize];
    }
    S::f32s::from_slice(simd, &numbers[..S::f32s::LEN])
}

/// Numbers `from..` of a block's.
#[inline(always)]
fn load<S: Simd>(simd: S, numbers: &Sixteen, from: usize) -> S::f32s {
    S::f32s::from_slice(simd, &numbers[from..from + S::f32s::LEN])
}

/// Attributes in the triangles' frames.
struct Local<'a> {
    template: &'a [Sixteen; ATTRIBUTES],
    residuals: &'a Residuals,
    from: usize,
}

impl Local<'_> {
    #[inline(always)]
    fn get<S: Simd>(&self, simd: S, plane: usize) -> S::f32s {
        load(simd, &self.template[plane], self.from) + load(simd, &self.residuals[plane], self.from)
    }
}

/// The greatest differences between `now` and `before`, plane by plane; NaN counts as no difference.
#[inline(always)]
fn compare<S: Simd>(
    simd: S,
    now: &[S::f32s; STATE_PLANES],
    before: &[S::f32s; STATE_PLANES],
) -> StateChange {
    let (place, scale) = (plane::POSITION.start, plane::LOG2_SCALE.start);
    let none = S::f32s::splat(simd, 0.0);
    let moved = squared_length::<S>([
        now[place] - before[place],
        now[place + 1] - before[place + 1],
        now[place + 2] - before[place + 2],
    ]);
    let mut octaves = greater((now[scale] - before[scale]).abs(), none);
    octaves = greater((now[scale + 1] - before[scale + 1]).abs(), octaves);
    octaves = greater((now[scale + 2] - before[scale + 2]).abs(), octaves);
    let opacity = (now[plane::OPACITY] - before[plane::OPACITY]).abs();
    StateChange {
        moved: greater(moved, none).reduce_max().sqrt(),
        octaves: octaves.reduce_max(),
        opacity: greater(opacity, none).reduce_max(),
    }
}

/// The greater of both, `most` where `number` is NaN.
#[inline(always)]
fn greater<V: SimdBase<S>, S: Simd>(number: V, most: V) -> V {
    number.simd_gt(most).select(number, most)
}

/// 1 / (1 + exp(-x)) to within 2e-7; NaN of NaN.
#[inline(always)]
fn sigmoid<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    // 2^t by whole and part; beyond these borders the result is 0 or 1 in any case.
    let t = (x * -LOG2_E).max(-126.0).min(126.0);
    let whole = t.round_ties_even();
    let part = t - whole;
    // Taylor's series of 2^part, part in -0.5..=0.5: the next term is 1.2e-7 at most.
    let mut power = S::f32s::splat(simd, 1.540_353e-4);
    for term in [
        1.333_355_8e-3,
        9.618_13e-3,
        5.550_411e-2,
        0.240_226_5,
        std::f32::consts::LN_2,
        1.0,
    ] {
        power = power.mul_add(part, S::f32s::splat(simd, term));
    }
    let exponent: S::i32s = (whole + 127.0).to_int::<S::i32s>() << 23;
    let scale: S::f32s = exponent.bitcast();
    let opacity = S::f32s::splat(simd, 1.0) / (power * scale + 1.0);
    x.is_nan().select(x, opacity)
}
