//! How much there is to do for a picture, counted in the lists that the renderer made of it.
//!
//! The blending is done once more here, on the CPU, as `raster.glsl` does it with waves of 64, a block of 8x8 pixels each: so it is known how many splats each
//! block tests and blends until nothing more shows. That picture is kept, to be compared with the drawn one.

use half::f16;
use renderer_splat::lists::{Splat, TILE_PIXELS, TileLists, ViewLists};
use serde::Serialize;

/// Side of a block, which one wave of 64 draws.
const BLOCK: u32 = 8;
const WAVE: usize = 64;
/// As `raster.glsl` has them.
const ALPHA_CUT: f32 = renderer_splat::gaussian::ALPHA_CUT;
const ALPHA_MOST: f32 = 0.99;
const TEST_SLACK: f32 = 1e-3;

/// What there is to do for a picture in all its views.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Work {
    /// Gaussians there are, seen or not.
    pub gaussians: u64,
    /// Those that are sorted.
    pub sorted: u64,
    /// Sorts a picture: less than 1 where an order serves several.
    pub sort_share: f64,
    /// Width and height of a view, pixels.
    pub size: [u64; 2],
    /// In each view.
    pub views: Vec<ViewWork>,
}

/// The work of one view.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ViewWork {
    /// Splats that cover a pixel's centre or might.
    pub splats: u64,
    /// Tiles of 16x16 pixels.
    pub tiles: u64,
    /// Pairs of splat and tile.
    pub pairs: u64,
    /// Blocks of 8x8 pixels in tiles with splats.
    pub blocks: u64,
    /// Waves' loads of 64 splats from a list, all blocks together.
    pub batches: u64,
    /// Splats that a block blended into its 64 pixels, all blocks together.
    pub blends: u64,
    /// The most that one block blended.
    pub most_blends: u64,
    /// Splats that the last batch of a block tested and did not need, all blocks together: what smaller batches would save.
    pub hidden: u64,
    /// Fragments that quads draw: pixel centres within each splat's hexagon.
    pub fragments: u64,
    /// The same with those that are shaded beside them, two by two.
    pub shaded: u64,
    /// Pixels with any splat.
    pub covered: u64,
    /// Red, green, blue (premultiplied) and alpha of each pixel, row by row.
    #[serde(skip)]
    pub pixels: Vec<[f32; 4]>,
}

impl Work {
    /// Counts a picture's work.
    #[must_use]
    pub fn of(lists: &TileLists) -> Self {
        let size = [lists.width, lists.height];
        Self {
            gaussians: lists.gaussians.into(),
            sorted: lists.order.len() as u64,
            sort_share: 1.0,
            size: size.map(u64::from),
            views: lists
                .views
                .iter()
                .map(|view| view_work(view, size))
                .collect(),
        }
    }

    /// A sum over the views.
    pub(crate) fn sum(&self, of: impl Fn(&ViewWork) -> u64) -> f64 {
        self.views.iter().map(of).sum::<u64>() as f64
    }

    /// Pixels of all views.
    pub(crate) fn pixels(&self) -> f64 {
        (self.size[0] * self.size[1] * self.views.len() as u64) as f64
    }
}

fn view_work(view: &ViewLists, size: [u32; 2]) -> ViewWork {
    let [width, height] = size;
    let tiles_across = width.div_ceil(TILE_PIXELS);
    let mut work = ViewWork {
        tiles: view.lists.len() as u64,
        pixels: vec![[0.0; 4]; width as usize * height as usize],
        ..ViewWork::default()
    };
    for (splat, tiles) in view.splats.iter().zip(&view.tiles) {
        if tiles.is_some() {
            work.splats += 1;
            let [fragments, shaded] = hexagon(splat, size);
            work.fragments += fragments;
            work.shaded += shaded;
        }
    }
    for (tile, list) in (0u32..).zip(&view.lists) {
        work.pairs += list.len() as u64;
        if list.is_empty() {
            continue;
        }
        let corner = [tile % tiles_across, tile / tiles_across].map(|at| at * TILE_PIXELS);
        for [x, y] in [[0, 0], [BLOCK, 0], [0, BLOCK], [BLOCK, BLOCK]] {
            let at = [corner[0] + x, corner[1] + y];
            if at[0] < width && at[1] < height {
                draw_block(&mut work, view, list, at, size);
            }
        }
    }
    work.covered = work.pixels.iter().filter(|pixel| pixel[3] > 0.0).count() as u64;
    work
}

/// Draws one block as one wave does.
fn draw_block(
    work: &mut ViewWork,
    view: &ViewLists,
    list: &[u32],
    at: [u32; 2],
    [width, height]: [u32; 2],
) {
    let end = [(at[0] + BLOCK).min(width), (at[1] + BLOCK).min(height)];
    let low = at.map(|at| at as f32 + 0.5);
    let high = end.map(|end| end as f32 - 0.5);
    let mut sums = [[0.0f32; 3]; WAVE];
    let mut left = [0.0f32; WAVE];
    let pixels = || (at[1]..end[1]).flat_map(|y| (at[0]..end[0]).map(move |x| (x, y)));
    let lane = |x: u32, y: u32| ((y - at[1]) * BLOCK + x - at[0]) as usize;
    let log2_cut = ALPHA_CUT.log2();
    for (x, y) in pixels() {
        left[lane(x, y)] = 1.0;
    }
    let mut blends = 0;
    for batch in list.chunks(WAVE) {
        work.batches += 1;
        let touching = (batch.iter())
            .filter_map(|index| view.splats.get(*index as usize))
            .filter(|splat| peak(splat, low, high) > log2_cut - TEST_SLACK);
        for splat in touching {
            if left.iter().all(|left| *left < ALPHA_CUT) {
                work.hidden += 1;
            }
            blends += 1;
            let colour = colour(splat);
            for (x, y) in pixels() {
                let lane = lane(x, y);
                let log2_alpha = log2_alpha(splat, x as f32 + 0.5, y as f32 + 0.5);
                if log2_alpha >= log2_cut {
                    let weight = log2_alpha.exp2().min(ALPHA_MOST) * left[lane];
                    for (sum, colour) in sums[lane].iter_mut().zip(colour) {
                        *sum += weight * colour;
                    }
                    left[lane] -= weight;
                }
            }
        }
        if left.iter().all(|left| *left < ALPHA_CUT) {
            break;
        }
    }
    work.blocks += 1;
    work.blends += blends;
    work.most_blends = work.most_blends.max(blends);
    for (x, y) in pixels() {
        let [red, green, blue] = sums[lane(x, y)];
        if let Some(pixel) = (work.pixels).get_mut(y as usize * width as usize + x as usize) {
            *pixel = [red, green, blue, 1.0 - left[lane(x, y)]];
        }
    }
}

fn log2_alpha(splat: &Splat, x: f32, y: f32) -> f32 {
    let (x, y) = (x - splat.mean_x, y - splat.mean_y);
    splat.log2_opacity - (splat.ux * x + splat.uy * y).powi(2) - (splat.wy * y).powi(2)
}

/// Greatest log2 of alpha over pixel centres from `low` to `high`; `block_peak` in `raster.glsl`.
fn peak(splat: &Splat, low: [f32; 2], high: [f32; 2]) -> f32 {
    let mean = [splat.mean_x, splat.mean_y];
    let [near, far] = [low, high].map(|end| [end[0] - mean[0], end[1] - mean[1]]);
    let beside = [0, 1].map(|axis| near[axis] > 0.0 || far[axis] < 0.0);
    if beside == [false; 2] {
        return splat.log2_opacity;
    }
    let (ux, uy, wy) = (splat.ux, splat.uy, splat.wy);
    let side = |axis: usize| {
        if near[axis] > 0.0 {
            near[axis]
        } else {
            far[axis]
        }
    };
    let value = |x: f32, y: f32| (ux * x + uy * y).powi(2) + (wy * y).powi(2);
    let mut least = f32::INFINITY;
    if beside[0] {
        let x = side(0);
        let y = (-ux * uy * x / (uy * uy + wy * wy)).clamp(near[1], far[1]);
        least = least.min(value(x, y));
    }
    if beside[1] {
        let y = side(1);
        let x = (-uy * y / ux).clamp(near[0], far[0]);
        least = least.min(value(x, y));
    }
    splat.log2_opacity - least
}

/// Pixel centres in a splat's hexagon, and pixels in the two-by-twos that have any of them; as `quad.vert` lays it out, but for splats over the picture's edge, whose
/// boxes it draws.
fn hexagon(splat: &Splat, [width, height]: [u32; 2]) -> [u64; 2] {
    let reach = (splat.log2_opacity - ALPHA_CUT.log2()).max(0.0).sqrt();
    let row_reach = reach / splat.wy;
    let centres = |from: f32, to: f32, end: u32| {
        let first = (from - 0.5).ceil().max(0.0);
        let last = (to - 0.5).floor().min(end as f32 - 1.0);
        #[expect(clippy::cast_possible_truncation, reason = "within a picture")]
        (first <= last).then_some([first as u32, last as u32])
    };
    let Some([top, bottom]) = centres(splat.mean_y - row_reach, splat.mean_y + row_reach, height)
    else {
        return [0; 2];
    };
    let across = |y: u32| {
        let y = y as f32 + 0.5 - splat.mean_y;
        let middle = splat.mean_x - splat.uy * y / splat.ux;
        // The slanted sides are as far from the middle as the level ones.
        let half = (reach - 0.5 * (splat.wy * y).abs()) / (0.75f32.sqrt() * splat.ux);
        centres(middle - half, middle + half, width)
    };
    let (mut fragments, mut shaded) = (0, 0);
    for pair in top / 2..=bottom / 2 {
        let rows = [2 * pair, 2 * pair + 1]
            .into_iter()
            .filter(|y| (top..=bottom).contains(y));
        let spans = || rows.clone().filter_map(across);
        fragments += spans()
            .map(|[first, last]| u64::from(last - first + 1))
            .sum::<u64>();
        let first = spans().map(|span| span[0]).min();
        let last = spans().map(|span| span[1]).max();
        if let (Some(first), Some(last)) = (first, last) {
            shaded += 4 * u64::from(last / 2 - first / 2 + 1);
        }
    }
    [fragments, shaded]
}

fn colour(splat: &Splat) -> [f32; 3] {
    let halves = |word: u32| {
        let [low_0, low_1, high_0, high_1] = word.to_le_bytes();
        [[low_0, low_1], [high_0, high_1]].map(|bytes| f16::from_le_bytes(bytes).to_f32())
    };
    let ([red, green], [blue, _]) = (halves(splat.red_green), halves(splat.blue_depth));
    [red, green, blue]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A round splat of this standard deviation, pixels.
    fn ball(x: f32, y: f32, deviation: f32, opacity: f32) -> Splat {
        let u = (0.5 * std::f32::consts::LOG2_E).sqrt() / deviation;
        Splat {
            mean_x: x,
            mean_y: y,
            ux: u,
            uy: 0.0,
            wy: u,
            log2_opacity: opacity.log2(),
            // 1 and 0.5; 0.25.
            red_green: 0x3800_3C00,
            blue_depth: 0x3400,
        }
    }

    fn alone(splats: Vec<Splat>) -> Work {
        let count = u32::try_from(splats.len()).expect("few");
        Work::of(&TileLists {
            width: 32,
            height: 16,
            gaussians: count,
            order: (0..count).collect(),
            views: vec![ViewLists {
                tiles: vec![Some([0, 0, 1, 0]); splats.len()],
                splats,
                lists: vec![(0..count).collect(), Vec::new()],
            }],
        })
    }

    #[test]
    fn a_splat_is_blended_by_the_blocks_it_reaches_and_drawn_by_its_quads_pixels() {
        // At half opacity it reaches sqrt(2 ln(127.5)) = 3.11 deviations: 3.11 pixels around the first block's middle.
        let work = alone(vec![ball(4.0, 4.0, 1.0, 0.5)]);
        let view = &work.views[0];
        assert_eq!((view.pairs, view.blocks, view.batches), (1, 4, 4));
        assert_eq!(view.blends, 1, "it stays within one block");
        // Rows are 0.5, 1.5 and 2.5 away, each above and below. There the hexagon is (3.11 - half of that) / 0.866 = 3.30, 2.73 and 2.15 wide to either
        // side: centres up to 2.5, 2.5 and 1.5 away.
        assert_eq!(view.fragments, 2 * (6 + 6 + 4));
        // Those rows' pixels lie in two and in four two-by-twos across.
        assert_eq!(view.shaded, 4 * 2 * (2 + 4));
        let [red, green, blue, alpha] = view.pixels[4 * 32 + 4];
        let expected = 0.5 * (-0.25f32).exp();
        assert!((alpha - expected).abs() < 1e-6, "{alpha}");
        assert_eq!([green / red, blue / red], [0.5, 0.25]);
    }

    #[test]
    fn what_lies_behind_a_wall_is_listed_but_not_blended() {
        let wall = vec![ball(8.0, 8.0, 40.0, 0.99); 64];
        let hidden = vec![ball(8.0, 8.0, 2.0, 0.9); 640];
        let work = alone([wall, hidden].concat());
        let view = &work.views[0];
        assert_eq!(
            view.batches, 4,
            "a batch for each block, though there are eleven"
        );
        assert_eq!(view.blends, 4 * 64);
        assert!(
            view.hidden > 4 * 50,
            "two or three make a wall: {}",
            view.hidden
        );
        assert_eq!(view.covered, 256, "the tile");
    }
}
