//! Two states and a display time -> packed Gaussians: Slerp on the shortest arc for rotations, Lerp for the rest.
//!
//! Reads each number of both states once and writes each packed Gaussian once, so that it is meant to be as fast as
//! copying as much memory.

use super::Detail;
use super::slerp::SlerpWeights;
use super::{check_count, check_range, in_halves};
use crate::KernelError;
use crate::state::{GaussianState, STATE_PLANES, plane};
use bytemuck::Zeroable;
use fearless_simd::{Level, dispatch, prelude::*};
use shaders_spirv::{GaussianLanes, LOG2_MOST_SCALE, LOG2_SCALE_END, PackedGaussian};
use std::ops::Range;

/// Furthest that a display time may lie beyond the newer state, in periods of the motion.
pub const MOST_ALPHA: f32 = 2.0;

/// The interpolation between two states at one display time, ready to be packed.
#[derive(Debug, Clone, Copy)]
pub struct Blend<'a> {
    from: &'a GaussianState,
    to: &'a GaussianState,
    alpha: f32,
    rotation: SlerpWeights,
    level: Level,
}

impl<'a> Blend<'a> {
    /// `alpha` is 0 at `from` and 1 at `to`; beyond 1 it extrapolates, up to [`MOST_ALPHA`]. It is clamped to
    /// 0..=2, and taken as 1 if it is not a number.
    ///
    /// # Errors
    /// If the states are not of one length.
    pub fn new(
        from: &'a GaussianState,
        to: &'a GaussianState,
        alpha: f32,
    ) -> Result<Self, KernelError> {
        check_count("Gaussians of the newer state", to.len(), from.len())?;
        let alpha = if alpha.is_nan() {
            1.0
        } else {
            alpha.clamp(0.0, MOST_ALPHA)
        };
        Ok(Self {
            from,
            to,
            alpha,
            rotation: SlerpWeights::at(alpha),
            level: Level::new(),
        })
    }

    /// As [`Self::new`], on another level of the processor.
    #[cfg(test)]
    pub(super) fn at_level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// Packs Gaussians `range` into `out`, as long as the range. Every packed Gaussian is written once, whole, in order
    /// (of its thread's part), and never read: `out` may be memory mapped from the device.
    ///
    /// Runs on rayon's current pool and allocates nothing there.
    ///
    /// # Errors
    /// If `range` is not within the states or `out` is of another length.
    pub fn pack(&self, range: Range<usize>, out: &mut [PackedGaussian]) -> Result<(), KernelError> {
        check_range(&range, self.from.len())?;
        check_count("packed Gaussians", out.len(), range.len())?;
        in_halves(range, out, &|range, out| {
            dispatch!(self.level, simd => self.pack_run(simd, range.start, out));
        });
        Ok(())
    }

    /// Packs the Gaussians that `detail` keeps into `out` in their order: a part of the person, by importance. See
    /// [`Self::pack`].
    ///
    /// # Errors
    /// If `detail` is of other states, or `out` is not as long as it keeps Gaussians.
    pub fn pack_kept(
        &self,
        detail: &Detail,
        out: &mut [PackedGaussian],
    ) -> Result<(), KernelError> {
        check_count("packed Gaussians", out.len(), detail.len())?;
        check_count("Gaussians of the states", self.from.len(), detail.of())?;
        in_halves(0..detail.len(), out, &|range, out| {
            dispatch!(self.level, simd => self.pack_some(simd, detail, range, out));
        });
        Ok(())
    }

    /// Gaussians one after another from `start`.
    #[inline(always)]
    fn pack_run<S: Simd>(&self, simd: S, start: usize, out: &mut [PackedGaussian]) {
        let planes = self.planes();
        let lanes = GaussianLanes::<S>::LEN;
        let mut chunks = out.chunks_exact_mut(lanes);
        let mut at = start;
        for chunk in &mut chunks {
            self.lanes(simd, &planes, at).pack(simd, chunk);
            at += lanes;
        }
        let rest = chunks.into_remainder();
        if !rest.is_empty() {
            let mut packed = [PackedGaussian::zeroed(); crate::state::MOST_LANES];
            let packed = &mut packed[..lanes];
            self.lanes(simd, &planes, at).pack(simd, packed);
            rest.copy_from_slice(&packed[..rest.len()]);
        }
    }

    /// Gaussians `kept`: as many neighbours at once as a vector holds, of which those that are kept are written.
    #[inline(always)]
    fn pack_some<S: Simd>(
        &self,
        simd: S,
        detail: &Detail,
        range: Range<usize>,
        out: &mut [PackedGaussian],
    ) {
        let planes = self.planes();
        let lanes = GaussianLanes::<S>::LEN;
        let mut packed = [PackedGaussian::zeroed(); crate::state::MOST_LANES];
        let packed = &mut packed[..lanes];
        let mut covered = 0..0;
        for (index, out) in detail.kept()[range].iter().zip(out) {
            let index = *index as usize;
            if !covered.contains(&index) {
                covered = index..index + lanes;
                let mut lanes = self.lanes(simd, &planes, index);
                let growth = load(simd, detail.log2_growth(), index);
                lanes.log2_scale = held(simd, lanes.log2_scale.map(|log2| log2 + growth));
                lanes.pack(simd, packed);
            }
            *out = packed[index - covered.start];
        }
    }

    fn planes(&self) -> Planes<'a> {
        Planes {
            from: self.from.all_padded(),
            to: self.to.all_padded(),
            alpha: self.alpha,
        }
    }

    /// The Gaussians from `at` on, as many as a vector holds.
    #[inline(always)]
    fn lanes<S: Simd>(&self, simd: S, planes: &Planes<'_>, at: usize) -> GaussianLanes<S> {
        let x = plane::ROTATION.start;
        let (y, z, w) = (x + 1, x + 2, x + 3);
        let (from, to) = (&planes.from, &planes.to);
        let a = [
            load(simd, from[x], at),
            load(simd, from[y], at),
            load(simd, from[z], at),
            load(simd, from[w], at),
        ];
        let b = [
            load(simd, to[x], at),
            load(simd, to[y], at),
            load(simd, to[z], at),
            load(simd, to[w], at),
        ];
        GaussianLanes {
            position: planes.lerp_three(simd, plane::POSITION.start, at),
            rotation: self.rotation.slerp(simd, a, b),
            log2_scale: held(simd, planes.lerp_three(simd, plane::LOG2_SCALE.start, at)),
            opacity: planes.lerp(simd, plane::OPACITY, at),
            colour: planes.lerp_three(simd, plane::COLOUR.start, at),
        }
    }
}

/// Both states' planes.
struct Planes<'a> {
    from: [&'a [f32]; STATE_PLANES],
    to: [&'a [f32]; STATE_PLANES],
    alpha: f32,
}

impl Planes<'_> {
    /// One plane's numbers from `at` on, interpolated.
    #[inline(always)]
    fn lerp<S: Simd>(&self, simd: S, plane: usize, at: usize) -> S::f32s {
        let (from, to) = (
            load(simd, self.from[plane], at),
            load(simd, self.to[plane], at),
        );
        // Subtracts the difference: then -0 stays -0, and equal states give equal bits.
        from - (from - to) * self.alpha
    }

    #[inline(always)]
    fn lerp_three<S: Simd>(&self, simd: S, first: usize, at: usize) -> [S::f32s; 3] {
        [
            self.lerp(simd, first, at),
            self.lerp(simd, first + 1, at),
            self.lerp(simd, first + 2, at),
        ]
    }
}

/// No larger than a person's Gaussians may be, whatever networks and extrapolation make of them. What is out of the packed layout's range, or no number,
/// stays so, and is not drawn.
#[inline(always)]
fn held<S: Simd>(simd: S, log2_scale: [S::f32s; 3]) -> [S::f32s; 3] {
    let most = S::f32s::splat(simd, LOG2_MOST_SCALE);
    let end = S::f32s::splat(simd, LOG2_SCALE_END);
    log2_scale.map(|log2| {
        let within = log2.simd_lt(end).select(most, log2);
        log2.simd_gt(most).select(within, log2)
    })
}

#[inline(always)]
fn load<S: Simd>(simd: S, plane: &[f32], at: usize) -> S::f32s {
    S::f32s::from_slice(simd, &plane[at..at + S::f32s::LEN])
}
