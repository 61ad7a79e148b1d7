//! Which pixels of a tile a splat meets, and its alpha at eight of them: shared by both passes, to the last bit.

use crate::projection::{LOG2_ALPHA_CUT, Splat};
use crate::tiles::{RUN, RUNS, TILE};
use crate::vector::{Eight, exp2};
use fearless_simd::{f32x8, mask32x8, prelude::*};

/// Nothing is more opaque than this.
const ALPHA_MOST: f32 = 0.99;
/// log2 of it.
const LOG2_ALPHA_MOST: f32 = -0.014_499_57;
/// A run takes no more splats once less than this shines through all of its pixels; as the renderer's blocks.
pub(super) const STOP: f32 = 1.0 / 255.0;
/// A pixel takes no more splats once less than this shines through it; as the public code of 3DGS.
pub(super) const OPAQUE: f32 = 1e-4;

/// Runs whose pixels still let something through, one bit each.
pub(super) type Runs = u32;

/// All runs of a tile that have a pixel in the picture, whose first pixel is at `at`; and the transmittance of a tile's pixels before
/// anything was blended: 0 beyond the picture's edge.
pub(super) fn open(at: [usize; 2], size: [usize; 2]) -> (Runs, [[f32; RUN]; RUNS]) {
    let mut open = 0;
    let mut transmittance = [[0.0; RUN]; RUNS];
    for (run, pixels) in transmittance.iter_mut().enumerate() {
        let (x, y) = (at[0] + run / TILE * RUN, at[1] + run % TILE);
        if y < size[1] && x < size[0] {
            open |= 1 << run;
            pixels[..RUN.min(size[0] - x)].fill(1.0);
        }
    }
    (open, transmittance)
}

/// Runs of the tile that the splat may reach.
#[inline(always)]
pub(super) fn reached(splat: &Splat, at: [usize; 2]) -> Runs {
    let side = TILE - 1;
    let first = usize::from(splat.rows[0]).saturating_sub(at[1]).min(side);
    let last = usize::from(splat.rows[1]).saturating_sub(at[1]).min(side);
    let rows: Runs = ((1 << (last + 1)) - 1) & !((1 << first) - 1);
    let middle = at[0] + RUN;
    let left = if usize::from(splat.columns[0]) < middle {
        rows
    } else {
        0
    };
    let right = if usize::from(splat.columns[1]) >= middle {
        rows << TILE
    } else {
        0
    };
    left | right
}

/// A splat in one half of a tile.
#[derive(Debug, Clone, Copy)]
pub(super) struct Half<'a, S: Simd> {
    splat: &'a Splat,
    /// From the mean to the pixels' columns.
    pub(super) dx: Eight<S>,
    along: Eight<S>,
    /// From the mean to the first row of pixels.
    top: f32,
}

/// A splat at the eight pixels of a run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Met<S: Simd> {
    /// From the mean to the pixels' row.
    pub(super) dy: f32,
    /// 0 where the splat is not drawn.
    pub(super) alpha: Eight<S>,
    log2_alpha: Eight<S>,
}

impl<'a, S: Simd> Half<'a, S> {
    /// `left` is the first column's pixel, `top` the first row's.
    #[inline(always)]
    #[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
    pub(super) fn new(simd: S, splat: &'a Splat, left: usize, top: usize) -> Self {
        let columns = f32x8::load_array(simd, [0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5]);
        let dx = columns + (left as f32 - splat.mean[0]);
        Self {
            splat,
            dx,
            along: dx * splat.u[0],
            top: top as f32 + 0.5 - splat.mean[1],
        }
    }

    /// In row `row` of the tile, at pixels through which `transmittance` still shines.
    #[inline(always)]
    pub(super) fn meet(&self, simd: S, row: usize, transmittance: Eight<S>) -> Met<S> {
        #[expect(clippy::cast_precision_loss, reason = "at most 15")]
        let dy = self.top + row as f32;
        let across = self.splat.w * dy;
        let along = self.along + self.splat.u[1] * dy;
        let log2_alpha =
            f32x8::splat(simd, self.splat.log2_opacity - across * across) - along * along;
        let drawn: mask32x8<S> = log2_alpha.simd_ge(LOG2_ALPHA_CUT) & transmittance.simd_ge(OPAQUE);
        let alpha = exp2(simd, log2_alpha).min(ALPHA_MOST);
        Met {
            dy,
            alpha: drawn.select(alpha, f32x8::splat(simd, 0.0)),
            log2_alpha,
        }
    }
}

impl<S: Simd> Met<S> {
    /// `derivative` where alpha follows the splat's numbers, 0 where it is held at its most.
    #[inline(always)]
    pub(super) fn follow(&self, simd: S, derivative: Eight<S>) -> Eight<S> {
        let follows: mask32x8<S> = self.log2_alpha.simd_lt(LOG2_ALPHA_MOST);
        follows.select(derivative, f32x8::splat(simd, 0.0))
    }
}
