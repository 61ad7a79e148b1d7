//! Which tiles of a picture anyone sees, where something before the display hides others: a lens, or a frame around it.
//!
//! For each row of tiles one run of columns, which all that is seen lies in. What is seen through a lens has no gaps, so little is drawn that
//! nobody sees; and to draw only that costs a comparison a row, not a test a tile.

use std::ops::RangeInclusive;

use glam::{DVec2, Vec2};
use shaders_spirv::{MOST_TILE_ROWS, TILE_PIXELS, VisibleRows};

use crate::camera::Camera;

/// How far around a point that is seen pixels are needed: a compositor that takes a picture's colours between pixels
/// reads the next ones, and no tile's fate may hang on rounding.
const MARGIN_PIXELS: f64 = 1.0;

/// A row in which nobody sees anything: the first tile is behind the last one.
const NONE: [u8; 2] = [1, 0];

/// The tiles of one view's picture that anyone sees.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VisibleTiles {
    width: u32,
    height: u32,
    /// First and last column, or [`NONE`].
    rows: [[u8; 2]; MOST_TILE_ROWS],
}

impl VisibleTiles {
    /// All tiles of a picture of so many pixels, at most [`MOST_PIXELS`](crate::limits::MOST_PIXELS) on a side.
    #[must_use]
    pub fn all(width: u32, height: u32) -> Self {
        let mut this = Self::none(width, height);
        let last = column(f64::from(this.columns()) - 1.0, this.columns());
        let rows = this.row_count();
        this.rows.iter_mut().take(rows).for_each(|row| {
            *row = [0, last];
        });
        this
    }

    /// The tiles of a camera's picture in which anything of these triangles lies, or within a pixel of them. Corners are where a ray goes
    /// through the plane one metre before the camera: x to the right and y up, in metres. No number in them is infinite or NaN.
    #[must_use]
    pub fn showing(camera: &Camera, triangles: impl IntoIterator<Item = [Vec2; 3]>) -> Self {
        let mut this = Self::none(camera.width, camera.height);
        let scale = DVec2::new(f64::from(camera.fx), -f64::from(camera.fy));
        let centre = DVec2::new(f64::from(camera.cx), f64::from(camera.cy));
        for triangle in triangles {
            this.show(triangle.map(|corner| centre + scale * corner.as_dvec2()));
        }
        this
    }

    fn none(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            rows: [NONE; MOST_TILE_ROWS],
        }
    }

    /// Adds what lies in a triangle, whose corners are in pixels, y down.
    fn show(&mut self, triangle: [DVec2; 3]) {
        let tile = f64::from(TILE_PIXELS);
        let [a, b, c] = triangle;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let (rows, columns) = (self.row_count(), self.columns());
        let most = f64::from(columns) - 1.0;
        for (index, row) in self.rows.iter_mut().enumerate().take(rows) {
            let top = index as f64 * tile - MARGIN_PIXELS;
            let bottom = (index as f64 + 1.0) * tile + MARGIN_PIXELS;
            if high.y < top || low.y > bottom {
                continue;
            }
            let Some([left, right]) = extent_within(triangle, top, bottom) else {
                continue;
            };
            let first = ((left - MARGIN_PIXELS) / tile).floor();
            let last = ((right + MARGIN_PIXELS) / tile).floor();
            if first > most || last < 0.0 {
                continue;
            }
            let seen = [column(first, columns), column(last, columns)];
            *row = if *row == NONE {
                seen
            } else {
                [row[0].min(seen[0]), row[1].max(seen[1])]
            };
        }
    }

    fn columns(&self) -> u32 {
        self.width.div_ceil(TILE_PIXELS)
    }

    fn row_count(&self) -> usize {
        (self.height.div_ceil(TILE_PIXELS) as usize).min(MOST_TILE_ROWS)
    }

    /// The picture's width and height, pixels.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The columns of a row, counted from the top, in which anyone sees something; nothing where there are none, or is no such row.
    #[must_use]
    pub fn columns_of(&self, row: usize) -> Option<RangeInclusive<u32>> {
        let [first, last] = *self.rows.get(row)?;
        (first <= last).then(|| first.into()..=last.into())
    }

    /// How many of the picture's tiles are drawn: 0 to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        let seen = (0..self.row_count()).filter_map(|row| self.columns_of(row));
        let tiles: usize = seen.map(|columns| columns.count()).sum();
        let all = self.row_count() * self.columns() as usize;
        tiles as f64 / all.max(1) as f64
    }

    /// As the shaders read it.
    #[must_use]
    pub fn rows(&self) -> VisibleRows {
        (self.rows).map(|[first, last]| u32::from(first) | u32::from(last) << 16)
    }
}

/// The least and the greatest x of what a triangle has between two heights, if it has anything there.
fn extent_within(triangle: [DVec2; 3], top: f64, bottom: f64) -> Option<[f64; 2]> {
    let mut extent: Option<[f64; 2]> = None;
    let mut take = |x: f64| {
        let [least, greatest] = extent.unwrap_or([x, x]);
        extent = Some([least.min(x), greatest.max(x)]);
    };
    for (index, from) in triangle.into_iter().enumerate() {
        let to = triangle[(index + 1) % 3];
        if (top..=bottom).contains(&from.y) {
            take(from.x);
        }
        for height in [top, bottom] {
            // Whether the side's ends are on both sides of that height.
            if (from.y < height) != (to.y < height) {
                let share = (height - from.y) / (to.y - from.y);
                take(from.x + share * (to.x - from.x));
            }
        }
    }
    extent
}

/// A column's number, held within a picture of so many.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "held within 0..=255"
)]
fn column(number: f64, columns: u32) -> u8 {
    number.clamp(0.0, f64::from(columns.clamp(1, 256) - 1)) as u8
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};
    use proptest::prelude::*;

    use super::*;
    use crate::camera::Fov;

    fn camera(fov: Fov, width: u32, height: u32) -> Camera {
        Camera::from_fov(Vec3::ZERO, Quat::IDENTITY, fov, width, height)
    }

    const FOV: Fov = Fov {
        left: -0.9,
        right: 0.7,
        up: 0.8,
        down: -0.85,
    };

    /// Whether a point is in a triangle or on its edge: it is on no side's outer half, whichever way round the corners go.
    fn holds(triangle: [Vec2; 3], point: DVec2) -> bool {
        let [a, b, c] = triangle.map(|corner| corner.as_dvec2());
        let turns = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(point - from));
        turns.iter().all(|turn| *turn >= 0.0) || turns.iter().all(|turn| *turn <= 0.0)
    }

    /// Where a pixel's centre is on the plane one metre before the camera, from the angles of its view alone.
    fn on_plane(fov: Fov, [width, height]: [u32; 2], x: u32, y: u32) -> DVec2 {
        let tangents = [fov.left, fov.right, fov.up, fov.down].map(|angle| f64::from(angle).tan());
        let [left, right, up, down] = tangents;
        let (across, along) = (
            (f64::from(x) + 0.5) / f64::from(width),
            (f64::from(y) + 0.5) / f64::from(height),
        );
        DVec2::new(left + across * (right - left), up + along * (down - up))
    }

    fn shows(tiles: &VisibleTiles, x: u32, y: u32) -> bool {
        let columns = tiles.columns_of((y / TILE_PIXELS) as usize);
        columns.is_some_and(|columns| columns.contains(&(x / TILE_PIXELS)))
    }

    fn corner() -> impl Strategy<Value = Vec2> {
        (-2.0f32..2.0, -2.0f32..2.0).prop_map(|(x, y)| Vec2::new(x, y))
    }

    proptest! {
        #[test]
        fn no_tile_with_a_pixel_in_a_triangle_is_left_out(
            triangles in prop::collection::vec([corner(), corner(), corner()], 1..6),
            width in 1u32..200,
            height in 1u32..200,
        ) {
            let tiles = VisibleTiles::showing(&camera(FOV, width, height), triangles.iter().copied());
            for y in 0..height {
                for x in 0..width {
                    let point = on_plane(FOV, [width, height], x, y);
                    let seen = triangles.iter().any(|triangle| holds(*triangle, point));
                    prop_assert!(!seen || shows(&tiles, x, y), "pixel {x}, {y} of {width}x{height}");
                }
            }
        }

        #[test]
        fn the_first_and_last_tile_of_a_row_have_something_of_a_triangle_near(
            triangle in [corner(), corner(), corner()],
        ) {
            let size = [160u32, 160];
            let tiles = VisibleTiles::showing(&camera(FOV, size[0], size[1]), [triangle]);
            let origin = on_plane(FOV, size, 0, 0);
            let step = on_plane(FOV, size, 1, 1) - origin;
            let in_pixels = triangle.map(|corner| (corner.as_dvec2() - origin) / step + 0.5);
            // Points of its sides a fifth of a pixel apart, or it covers the tile.
            let near = |column: u32, row: usize| {
                let middle = DVec2::new(f64::from(column), row as f64) * 16.0 + 8.0;
                let within = |point: DVec2| (point - middle).abs().max_element() <= 8.0 + 2.5;
                let side = |index: usize| {
                    let (from, to) = (in_pixels[index], in_pixels[(index + 1) % 3]);
                    (0..=3000).any(|share| within(from.lerp(to, f64::from(share) / 3000.0)))
                };
                (0..3).any(side) || holds(triangle, origin + (middle - 0.5) * step)
            };
            for row in 0..10 {
                if let Some(columns) = tiles.columns_of(row) {
                    for end in [*columns.start(), *columns.end()] {
                        prop_assert!(near(end, row), "column {end} of row {row}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_view_that_is_seen_wholly_shows_all_tiles_and_one_that_is_not_shows_none() {
        let camera = camera(FOV, 250, 130);
        let wide = [
            Vec2::new(-9.0, -9.0),
            Vec2::new(20.0, -9.0),
            Vec2::new(-9.0, 20.0),
        ];
        let all = VisibleTiles::showing(&camera, [wide]);
        assert_eq!(all, VisibleTiles::all(250, 130), "all");
        assert_eq!(all.share(), 1.0, "all");
        assert_eq!(all.columns_of(8), Some(0..=15), "the last row");
        assert_eq!(all.columns_of(9), None, "there is no such row");
        let beside = wide.map(|corner| corner + Vec2::new(40.0, 0.0));
        let none = VisibleTiles::showing(&camera, [beside]);
        assert_eq!(none.share(), 0.0, "none");
        let huge = wide.map(|corner| corner * 1e37);
        assert_eq!(VisibleTiles::showing(&camera, [huge]), all, "far away");
    }

    #[test]
    fn what_the_shaders_read_is_first_and_last_column() {
        let words = VisibleTiles::all(4096, 4096).rows();
        assert!(words.iter().all(|word| *word == 255 << 16), "all");
        let words = VisibleTiles::none(64, 64).rows();
        assert!(words.iter().all(|word| *word == 1), "the first is behind");
        assert_eq!(
            VisibleTiles::all(20, 16).rows()[..2],
            [1 << 16, 1],
            "two tiles"
        );
    }
}
