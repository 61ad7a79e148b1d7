//! The picture's tiles, and the list of splats that each may show, from front to back.

use crate::projection::{ALPHA_CUT_SLACK, LOG2_ALPHA_CUT, Moments, Splat};
use rayon::prelude::*;

/// Pixels along a tile's sides.
pub(crate) const TILE: usize = 16;
/// Pixels that are blended together: half a row of a tile.
pub(crate) const RUN: usize = 8;
/// Runs of a tile: those of the left half from the top, then those of the right half.
pub(crate) const RUNS: usize = TILE * TILE / RUN;
/// One number of every pixel of a tile, run by run.
pub(crate) type TilePlane = [[f32; RUN]; RUNS];

/// A square of the picture.
#[derive(Debug, Clone)]
pub(crate) struct Tile {
    /// Ranks of the splats that may show, rising.
    pub(crate) ranks: Vec<u32>,
    /// The splats themselves, so that they are read one after the other.
    pub(crate) splats: Vec<Splat>,
    /// How many of them were blended before nothing more showed.
    pub(crate) blended: usize,
    /// Premultiplied red, green, blue, then transmittance.
    pub(crate) pixels: [TilePlane; 4],
    /// What each blended splat gathers here in the backward pass.
    pub(crate) moments: Vec<Moments>,
}

impl Tile {
    const EMPTY: Self = Self {
        ranks: Vec::new(),
        splats: Vec::new(),
        blended: 0,
        pixels: [[[0.0; RUN]; RUNS]; 4],
        moments: Vec::new(),
    };
}

/// All tiles of a picture.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tiles {
    /// Tiles in a row.
    pub(crate) across: usize,
    /// Row by row.
    pub(crate) tiles: Vec<Tile>,
    /// Ranks of the splats that touch each row of tiles.
    rows: Vec<Vec<u32>>,
}

impl Tiles {
    /// Fills the lists; `splats` are in the order of their rank.
    pub(crate) fn list(&mut self, splats: &[Splat], [width, height]: [usize; 2]) {
        self.across = width.div_ceil(TILE);
        let down = height.div_ceil(TILE);
        self.tiles.resize(self.across * down, Tile::EMPTY);
        self.rows.resize(down, Vec::new());
        self.rows.iter_mut().for_each(Vec::clear);
        for (rank, splat) in (0..).zip(splats) {
            let [first, last] = splat.rows.map(|row| usize::from(row) / TILE);
            for row in &mut self.rows[first..=last] {
                row.push(rank);
            }
        }
        let rows = self.tiles.par_chunks_mut(self.across).zip(&self.rows);
        rows.enumerate().for_each(|(row, (tiles, ranks))| {
            for tile in tiles.iter_mut() {
                tile.ranks.clear();
                tile.splats.clear();
                // A tile that stays empty is not blended: nothing of the last picture may be left in it.
                tile.moments.clear();
                tile.blended = 0;
            }
            for rank in ranks {
                let splat = &splats[*rank as usize];
                let [first, last] = splat.columns.map(|column| usize::from(column) / TILE);
                // A small one meets the only tile it may reach.
                let small = first == last && splat.rows.map(|y| usize::from(y) / TILE) == [row; 2];
                for (column, tile) in (first..).zip(&mut tiles[first..=last]) {
                    if small || splat.touches([column * TILE, row * TILE]) {
                        tile.ranks.push(*rank);
                        tile.splats.push(*splat);
                    }
                }
            }
        });
    }
}

impl Splat {
    /// Whether alpha reaches the cut at some pixel centre's height and width of the tile whose first pixel is `at`. Never no
    /// where it does.
    #[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
    fn touches(&self, at: [usize; 2]) -> bool {
        let side = (TILE - 1) as f32;
        let near = [0, 1].map(|axis| at[axis] as f32 + 0.5 - self.mean[axis]);
        let far = near.map(|near| near + side);
        if near[0] <= 0.0 && far[0] >= 0.0 && near[1] <= 0.0 && far[1] >= 0.0 {
            return true;
        }
        // The quadratic is convex: its least lies on a side that faces the mean.
        let [ux, uy] = self.u;
        let power = |x: f32, y: f32| {
            let (along, across) = (ux * x + uy * y, self.w * y);
            along * along + across * across
        };
        let mut least = f32::INFINITY;
        if near[0] > 0.0 || far[0] < 0.0 {
            let x = if near[0] > 0.0 { near[0] } else { far[0] };
            let y = -ux * uy * x / (uy * uy + self.w * self.w);
            least = power(x, y.clamp(near[1], far[1]));
        }
        if near[1] > 0.0 || far[1] < 0.0 {
            let y = if near[1] > 0.0 { near[1] } else { far[1] };
            let x = -uy * y / ux;
            least = least.min(power(x.clamp(near[0], far[0]), y));
        }
        self.log2_opacity - least > LOG2_ALPHA_CUT - ALPHA_CUT_SLACK
    }
}
