//! From Gaussians and a view to a picture, and from the derivatives by its pixels to those by the Gaussians.

use crate::attributes::{ATTRIBUTES, Attributes};
use crate::error::{GradientError, check_count};
use crate::order::Sorter;
use crate::picture::{CHANNELS, Picture};
use crate::projection::{CHUNK, MOMENTS, Moments, NEVER, Splat, project, pull_back};
use crate::raster::{blend, gather};
use crate::tiles::{RUN, RUNS, TILE, Tile, TilePlane, Tiles};
use crate::view::{Twist, View};
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;

/// Draws pictures; keeps its memory from one to the next: about 50 bytes for every tile of 16x16 pixels that a Gaussian touches, and 36
/// more where it is not hidden. A million Gaussians as large as the picture are more than a machine holds: a trainer bounds their scale.
#[derive(Debug, Clone)]
pub struct Splatter {
    level: Level,
    sorter: Sorter,
    /// By index, and the keys they are sorted by.
    projected: Vec<Splat>,
    keys: Vec<u32>,
    /// Rank to index, and back ([`NEVER`] where nothing is drawn).
    order: Vec<u32>,
    ranks: Vec<u32>,
    /// By rank.
    splats: Vec<Splat>,
    moments: Vec<Moments>,
    tiles: Tiles,
    picture: Picture,
}

impl Default for Splatter {
    fn default() -> Self {
        Self::new()
    }
}

impl Splatter {
    /// Uses the widest vectors that this processor has.
    #[must_use]
    pub fn new() -> Self {
        Self {
            level: Level::new(),
            sorter: Sorter::default(),
            projected: Vec::new(),
            keys: Vec::new(),
            order: Vec::new(),
            ranks: Vec::new(),
            splats: Vec::new(),
            moments: Vec::new(),
            tiles: Tiles::default(),
            picture: Picture::default(),
        }
    }

    /// Draws Gaussians (world space) as a view sees them, before nothing. Runs on rayon's current pool.
    pub fn draw<'a>(&'a mut self, gaussians: &'a Attributes, view: &View) -> Drawn<'a> {
        let size = view.size();
        self.project(gaussians, view);
        self.sorter.sort(&self.keys, &mut self.order);
        self.rank(gaussians.len());
        self.tiles.list(&self.splats, size);

        let level = self.level;
        let across = self.tiles.across;
        let tiles = self.tiles.tiles.par_iter_mut().enumerate();
        let filled = tiles.filter(|(_, tile)| !tile.ranks.is_empty());
        filled.for_each(|(index, tile)| {
            let at = first_pixel(index, across);
            dispatch!(level, simd => blend(simd, tile, at, size));
        });
        self.picture.reset(size[0], size[1]);
        let planes = self.picture.planes_mut();
        let tiles = &self.tiles.tiles;
        for (channel, plane) in planes.into_iter().enumerate() {
            let rows = plane.par_chunks_mut(size[0]).enumerate();
            rows.with_min_len(TILE).for_each(|(y, row)| {
                let tiles = &tiles[y / TILE * across..];
                for (runs, tile) in row.chunks_mut(TILE).zip(tiles) {
                    if !tile.ranks.is_empty() {
                        show(tile, channel, y % TILE, runs);
                    }
                }
            });
        }
        Drawn {
            splatter: self,
            gaussians,
            view: *view,
        }
    }

    /// Fills `projected` and `keys`.
    fn project(&mut self, gaussians: &Attributes, view: &View) {
        let (level, lens) = (self.level, view.lens());
        let planes = gaussians.planes();
        self.projected.resize(gaussians.len(), Splat::default());
        self.keys.resize(gaussians.len(), NEVER);
        let splats = self.projected.par_chunks_mut(CHUNK);
        let chunks = splats.zip(self.keys.par_chunks_mut(CHUNK)).enumerate();
        chunks.for_each(|(chunk, (splats, keys))| {
            let start = chunk * CHUNK;
            dispatch!(level, simd => project(simd, &lens, &planes, start, splats, keys));
        });
    }

    /// Fills `ranks` and `splats` from `order`.
    fn rank(&mut self, count: usize) {
        self.ranks.clear();
        self.ranks.resize(count, NEVER);
        for (rank, index) in (0..).zip(&self.order) {
            self.ranks[*index as usize] = rank;
        }
        let projected = &self.projected;
        let sorted = self.order.par_iter().with_min_len(CHUNK);
        let sorted = sorted.map(|index| projected[*index as usize]);
        sorted.collect_into_vec(&mut self.splats);
    }
}

/// A picture, with what its derivatives are computed from.
#[derive(Debug)]
pub struct Drawn<'a> {
    splatter: &'a mut Splatter,
    gaussians: &'a Attributes,
    view: View,
}

impl Drawn<'_> {
    /// What the view shows: premultiplied colours and alpha.
    #[must_use]
    pub fn picture(&self) -> &Picture {
        &self.splatter.picture
    }

    /// Adds the derivatives of a loss by the Gaussians' numbers to `gradients`, of as many Gaussians, and returns those by a motion
    /// of the camera ([`View::moved`] at 0). `by_pixel` has the derivatives by the picture's numbers, in its layout.
    ///
    /// Where alpha is cut, held at 0.99 or hidden, its derivative is 0: the cuts themselves have none. Runs on rayon's current pool.
    ///
    /// # Errors
    /// A picture of another size, another number of Gaussians.
    pub fn backward(
        &mut self,
        by_pixel: &Picture,
        gradients: &mut Attributes,
    ) -> Result<Twist, GradientError> {
        let size = self.view.size();
        by_pixel.check_size("derivatives by pixels", size)?;
        check_count("Gaussians", gradients.len(), self.gaussians.len())?;
        let Splatter {
            level,
            splats,
            moments,
            tiles,
            ranks,
            ..
        } = &mut *self.splatter;
        let (level, across) = (*level, tiles.across);
        let all = tiles.tiles.par_iter_mut().enumerate();
        all.filter(|(_, tile)| !tile.ranks.is_empty())
            .for_each(|(index, tile)| {
                let at = first_pixel(index, across);
                let by_pixel = cut_out(by_pixel, at);
                dispatch!(level, simd => gather(simd, tile, &by_pixel, at, size));
            });
        sum_up(&tiles.tiles, splats.len(), moments);

        let (lens, planes) = (self.view.lens(), self.gaussians.planes());
        let (ranks, moments) = (&*ranks, &*moments);
        let moments_of = |index: usize| moments.get(ranks[index] as usize);
        let motions: Vec<Twist> = in_chunks(gradients.planes_mut())
            .into_par_iter()
            .enumerate()
            .map(|(chunk, mut out)| {
                let start = chunk * CHUNK;
                dispatch!(level, simd => pull_back(simd, &lens, &planes, start, moments_of, &mut out))
            })
            .collect();
        Ok(motions.iter().fold([0.0; 6], |sum, motion| {
            std::array::from_fn(|k| sum[k] + motion[k])
        }))
    }
}

/// A tile's first pixel.
fn first_pixel(index: usize, across: usize) -> [usize; 2] {
    [index % across * TILE, index / across * TILE]
}

/// Copies a channel of a row of a tile, alpha in the place of transmittance.
fn show(tile: &Tile, channel: usize, row: usize, out: &mut [f32]) {
    for (half, out) in out.chunks_mut(RUN).enumerate() {
        let run = &tile.pixels[channel][half * TILE + row];
        copy_run(run, out);
        if channel + 1 == CHANNELS {
            for through in out {
                *through = 1.0 - *through;
            }
        }
    }
}

/// Copies as many pixels as there is room for; eight, as a rule, which then are no call.
fn copy_run(from: &[f32], to: &mut [f32]) {
    if let (Some(from), Some(to)) = (from.first_chunk::<RUN>(), to.first_chunk_mut::<RUN>()) {
        *to = *from;
        return;
    }
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

/// A tile's pixels; 0 beyond the picture's edge.
fn cut_out(picture: &Picture, at: [usize; 2]) -> [TilePlane; CHANNELS] {
    let mut planes = [[[0.0; RUN]; RUNS]; CHANNELS];
    for (channel, plane) in planes.iter_mut().enumerate() {
        let rows = picture.plane(channel).chunks_exact(picture.width());
        for (row, pixels) in rows.skip(at[1]).take(TILE).enumerate() {
            for (half, pixels) in pixels[at[0]..].chunks(RUN).take(TILE / RUN).enumerate() {
                copy_run(pixels, &mut plane[half * TILE + row]);
            }
        }
    }
    planes
}

/// Adds up what splats gathered in their tiles, in the order of the tiles. Each thread takes splats of its own.
fn sum_up(tiles: &[Tile], count: usize, moments: &mut Vec<Moments>) {
    moments.clear();
    moments.resize(count, [0.0; MOMENTS]);
    let share = count.div_ceil(rayon::current_num_threads()).max(CHUNK);
    let shares = moments.par_chunks_mut(share).enumerate();
    shares.for_each(|(index, moments)| {
        let first = index * share;
        for tile in tiles {
            let ranks = &tile.ranks[..tile.blended];
            let from = ranks.partition_point(|rank| (*rank as usize) < first);
            for (rank, more) in ranks[from..].iter().zip(&tile.moments[from..]) {
                let Some(sums) = moments.get_mut(*rank as usize - first) else {
                    break;
                };
                for (sum, more) in sums.iter_mut().zip(more) {
                    *sum += more;
                }
            }
        }
    });
}

/// Planes cut into parts of [`CHUNK`] Gaussians.
fn in_chunks(planes: [&mut [f32]; ATTRIBUTES]) -> Vec<[&mut [f32]; ATTRIBUTES]> {
    let count = planes[0].len().div_ceil(CHUNK);
    let mut chunks = planes.map(|plane| plane.chunks_mut(CHUNK));
    (0..count)
        .map(|_| {
            chunks
                .each_mut()
                .map(|plane| plane.next().unwrap_or_default())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Affine3A, Vec3};
    use synthetic_person::Random;

    /// This processor's SIMD levels, the narrowest first.
    fn levels() -> Vec<Level> {
        let new = Level::new();
        #[cfg(target_arch = "x86_64")]
        let more = [
            new.as_sse4_2().map(Level::Sse4_2),
            new.as_avx2().map(Level::Avx2),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let more: [Option<Level>; 0] = [];
        let more = more.into_iter().flatten();
        [Level::baseline(), new].into_iter().chain(more).collect()
    }

    #[test]
    fn every_level_of_the_processor_gives_the_same_but_for_rounding() {
        let mut random = Random::new(8);
        let mut gaussians = Attributes::zeros(500);
        for plane in 0..ATTRIBUTES {
            for number in gaussians.plane_mut(plane) {
                let spread = if (7..10).contains(&plane) { -3.0 } else { 0.0 };
                *number = spread + random.signed();
            }
        }
        let pose = Affine3A::from_translation(Vec3::new(0.1, 0.0, 3.0));
        let view = View::new(pose, [60.0; 2], [24.0, 20.0], [48, 40]).expect("a camera");
        let numbers = (0..CHANNELS * 48 * 40).map(|_| random.signed()).collect();
        let by_pixel = Picture::new(48, 40, numbers).expect("as many");
        let results = levels().into_iter().map(|level| {
            let mut splatter = Splatter {
                level,
                ..Splatter::new()
            };
            let mut drawn = splatter.draw(&gaussians, &view);
            let picture = drawn.picture().clone();
            let mut gradients = Attributes::zeros(500);
            let motion = drawn.backward(&by_pixel, &mut gradients).expect("a size");
            (picture, gradients, motion)
        });
        let results: Vec<_> = results.collect();
        let (picture, gradients, motion) = &results[0];
        assert!(
            picture.numbers().iter().any(|x| *x > 0.5),
            "something to see"
        );
        let size = |numbers: &[f32]| numbers.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        for (other, more, other_motion) in &results[1..] {
            for (a, b) in picture.numbers().iter().zip(other.numbers()) {
                // An alpha of just 1/255 may be cut by one and not by another.
                assert!((a - b).abs() < 5e-3, "pixels: {a}, {b}");
            }
            for plane in 0..ATTRIBUTES {
                let most = size(gradients.plane(plane));
                for (a, b) in gradients.plane(plane).iter().zip(more.plane(plane)) {
                    assert!(
                        (a - b).abs() < 1e-2 * most,
                        "plane {plane}: {a}, {b}, of {most}"
                    );
                }
            }
            for (a, b) in motion.iter().zip(other_motion) {
                assert!((a - b).abs() < 1e-2 * a.abs().max(1.0), "motion: {a}, {b}");
            }
        }
    }
}
