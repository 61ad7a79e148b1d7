//! Which tiles of a picture anyone sees, where something before the display hides others: a lens, or a frame around it.
//!
//! For each row of tiles one run of columns, which all that is seen lies in. What is seen through a lens has no gaps, so little is drawn that
//! nobody sees; and to draw only that costs a look-up a row, not a test a tile, and nothing in rows that are seen wholly.

use std::ops::RangeInclusive;

use glam::{DVec2, Vec2};
use shaders_spirv::{MOST_TILE_ROWS, TILE_PIXELS, VisibleRows};

use crate::camera::Camera;

/// How far around a point that is seen pixels are needed: a compositor that takes a picture's colours between pixels
/// reads the next ones, and no tile's fate may hang on rounding.
const MARGIN_PIXELS: f64 = 1.0;
/// The same, in lines.
const MARGIN_LINES: u32 = 1;

/// Runs of hidden triangles that lie side by side meet within this, pixels: their common side is rounded twice.
const TOUCHING: f64 = 1e-6;

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

    /// The tiles of a camera's picture in which anything is that these triangles do not cover together, or within a pixel of them. Corners are
    /// where a ray goes through the plane one metre before the camera: x to the right and y up, in metres. No number in them is infinite
    /// or NaN.
    #[must_use]
    pub fn behind(camera: &Camera, hidden: impl IntoIterator<Item = [Vec2; 3]>) -> Self {
        let scale = DVec2::new(f64::from(camera.fx), -f64::from(camera.fy));
        let centre = DVec2::new(f64::from(camera.cx), f64::from(camera.cy));
        let mut hidden: Vec<[DVec2; 3]> = hidden
            .into_iter()
            .map(|triangle| triangle.map(|corner| centre + scale * corner.as_dvec2()))
            .collect();
        // From the top; those that a line may meet are few.
        let top = |triangle: &[DVec2; 3]| {
            triangle
                .map(|at| at.y)
                .into_iter()
                .fold(f64::INFINITY, f64::min)
        };
        let bottom = |triangle: &[DVec2; 3]| {
            triangle
                .map(|at| at.y)
                .into_iter()
                .fold(f64::NEG_INFINITY, f64::max)
        };
        hidden.sort_by(|a, b| top(a).total_cmp(&top(b)));
        let mut to_come = hidden.iter().peekable();
        let mut met: Vec<&[DVec2; 3]> = Vec::new();
        let mut this = Self::none(camera.width, camera.height);
        let tile = f64::from(TILE_PIXELS);
        let (width, columns) = (f64::from(camera.width), this.columns());
        let mut covered = Vec::new();
        for line in 0..camera.height {
            let height = f64::from(line) + 0.5;
            covered.clear();
            while let Some(next) = to_come.next_if(|next| top(next) <= height) {
                met.push(next);
            }
            met.retain(|one| bottom(one) >= height);
            covered.extend(met.iter().filter_map(|one| extent_at(one, height)));
            let Some([left, right]) = open_between(&mut covered, width) else {
                continue;
            };
            let seen = [left - MARGIN_PIXELS, right + MARGIN_PIXELS];
            let seen = seen.map(|x| column((x / tile).floor(), columns));
            // The rows of tiles that this line of pixels is in, or next to.
            let first = line.saturating_sub(MARGIN_LINES) / TILE_PIXELS;
            let last = (line + MARGIN_LINES).min(camera.height - 1) / TILE_PIXELS;
            for row in first..=last {
                if let Some(row) = this.rows.get_mut(row as usize) {
                    *row = match *row {
                        NONE => seen,
                        [first, last] => [first.min(seen[0]), last.max(seen[1])],
                    };
                }
            }
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

    /// Both views', as the shaders read them.
    #[must_use]
    pub fn rows([left, right]: &[Self; 2]) -> VisibleRows {
        std::array::from_fn(|row| {
            let [[first, last], [right_first, right_last]] = [left, right].map(|it| it.rows[row]);
            [first, last, right_first, right_last].map(u32::from)
        })
    }
}

/// The first and the last of the rows around the middle one that either view shows wholly, of pictures of one size; the first is behind the last
/// where the middle one is not.
pub(crate) fn whole_rows(views: &[VisibleTiles; 2]) -> [u32; 2] {
    let [left, right] = views;
    let whole = [0, column(f64::from(left.columns()) - 1.0, left.columns())];
    let is_whole = |row: usize| left.rows[row] == whole && right.rows[row] == whole;
    let middle = left.row_count() / 2;
    let above = (0..middle).rev().take_while(|row| is_whole(*row)).count();
    let below = (middle..left.row_count()).take_while(|row| is_whole(*row));
    let below = below.count();
    if below == 0 {
        return [1, 0];
    }
    let number = |row: usize| u32::try_from(row).unwrap_or(0);
    [number(middle - above), number(middle + below - 1)]
}

/// The least and the greatest x of what a triangle has at a height, if it has anything there.
fn extent_at(triangle: &[DVec2; 3], height: f64) -> Option<[f64; 2]> {
    let mut extent: Option<[f64; 2]> = None;
    let mut take = |x: f64| {
        let [least, greatest] = extent.unwrap_or([x, x]);
        extent = Some([least.min(x), greatest.max(x)]);
    };
    let [a, b, c] = *triangle;
    for (from, to) in [(a, b), (b, c), (c, a)] {
        if from.y == height {
            take(from.x);
        }
        if (from.y < height) != (to.y < height) {
            let share = (height - from.y) / (to.y - from.y);
            take(from.x + share * (to.x - from.x));
        }
    }
    extent
}

/// The first and the last x from 0 to `width` that none of these runs covers; nothing where they cover all of it.
fn open_between(covered: &mut [[f64; 2]], width: f64) -> Option<[f64; 2]> {
    covered.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut left = 0.0f64;
    for [from, to] in covered.iter() {
        if *from > left + TOUCHING {
            break;
        }
        left = left.max(*to);
    }
    covered.sort_unstable_by(|a, b| b[1].total_cmp(&a[1]));
    let mut right = width;
    for [from, to] in covered.iter() {
        if *to < right - TOUCHING {
            break;
        }
        right = right.min(*from);
    }
    (left < width && right > 0.0).then_some([left, right])
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
        fn no_tile_with_a_pixel_that_no_triangle_hides_is_left_out(
            triangles in prop::collection::vec([corner(), corner(), corner()], 0..12),
            width in 1u32..200,
            height in 1u32..200,
        ) {
            let tiles = VisibleTiles::behind(&camera(FOV, width, height), triangles.iter().copied());
            for y in 0..height {
                for x in 0..width {
                    let point = on_plane(FOV, [width, height], x, y);
                    let hidden = triangles.iter().any(|triangle| holds(*triangle, point));
                    prop_assert!(hidden || shows(&tiles, x, y), "pixel {x}, {y} of {width}x{height}");
                }
            }
        }

        #[test]
        fn tiles_that_lie_two_pixels_within_what_is_hidden_are_left_out(
            corners in [0.1f32..0.7, 0.1f32..0.7, 0.1f32..0.7, 0.1f32..0.7],
            split in 0.2f32..0.8,
        ) {
            let size = [300u32, 280];
            let [left, right, down, up] = [FOV.left, FOV.right, FOV.down, FOV.up].map(f32::tan);
            // Each corner of the picture hidden by a triangle that reaches beyond its edges, cut into two that share a side.
            let places = [(left, up), (right, up), (left, down), (right, down)];
            let whole: Vec<[Vec2; 3]> = places.iter().zip(corners).map(|((x, y), share)| {
                let beyond = Vec2::new(x + 0.01 * x.signum(), y + 0.01 * y.signum());
                let across = Vec2::new(-x.signum() * share * (right - left), 0.0);
                let along = Vec2::new(0.0, -y.signum() * share * (up - down));
                [beyond, beyond + across, beyond + along]
            }).collect();
            let cut = whole.iter().flat_map(|[a, b, c]| {
                let between = b.lerp(*c, split);
                [[*a, *b, between], [*c, *a, between]]
            });
            let tiles = VisibleTiles::behind(&camera(FOV, size[0], size[1]), cut);
            let origin = on_plane(FOV, size, 0, 0);
            let step = on_plane(FOV, size, 1, 1) - origin;
            let mut left_out = 0;
            for (row, column) in (0u32..18).flat_map(|row| (0u32..19).map(move |column| (row, column))) {
                let ends = [-2.5, 17.5];
                let within = |triangle: &[Vec2; 3]| ends.iter().all(|down| ends.iter().all(|across| {
                    let corner = DVec2::new(f64::from(column) * 16.0 + across, f64::from(row) * 16.0 + down);
                    holds(*triangle, origin + corner * step)
                }));
                if whole.iter().any(within) {
                    left_out += 1;
                    prop_assert!(!shows(&tiles, column * 16, row * 16), "column {column} of row {row}");
                }
            }
            prop_assume!(left_out > 0);
        }
    }

    #[test]
    fn a_view_with_nothing_before_it_shows_all_tiles_and_one_that_is_covered_none() {
        let camera = camera(FOV, 250, 130);
        let all = VisibleTiles::behind(&camera, []);
        assert_eq!(all, VisibleTiles::all(250, 130), "all");
        assert_eq!(all.share(), 1.0, "all");
        assert_eq!(all.columns_of(8), Some(0..=15), "the last row");
        assert_eq!(all.columns_of(9), None, "there is no such row");
        let wide = [
            Vec2::new(-9.0, -9.0),
            Vec2::new(20.0, -9.0),
            Vec2::new(-9.0, 20.0),
        ];
        let none = VisibleTiles::behind(&camera, [wide]);
        assert_eq!(none.share(), 0.0, "none");
        let huge = wide.map(|corner| corner * 1e37);
        assert_eq!(VisibleTiles::behind(&camera, [huge]), none, "far away");
        let beside = wide.map(|corner| corner + Vec2::new(40.0, 0.0));
        assert_eq!(VisibleTiles::behind(&camera, [beside]), all, "beside it");
        let point = [Vec2::ZERO; 3];
        assert_eq!(VisibleTiles::behind(&camera, [point]), all, "nothing");
    }

    #[test]
    fn a_hole_in_the_middle_of_a_row_is_drawn() {
        let camera = camera(FOV, 250, 130);
        let middle = [
            Vec2::new(-0.5, -0.5),
            Vec2::new(0.5, -0.5),
            Vec2::new(0.0, 0.5),
        ];
        let all = VisibleTiles::behind(&camera, [middle]);
        assert_eq!(all.share(), 1.0, "from the first column to the last");
    }

    #[test]
    fn what_the_shaders_read_is_first_and_last_column_of_either_view() {
        let rows = |left, right| VisibleTiles::rows(&[left, right]);
        let all = || VisibleTiles::all(4096, 4096);
        let of_all = rows(all(), all());
        assert!(of_all.iter().all(|row| *row == [0, 255, 0, 255]), "all");
        let none = rows(all(), VisibleTiles::none(64, 64));
        assert!(none.iter().all(|row| *row == [0, 255, 1, 0]), "one view");
        let two = rows(VisibleTiles::all(20, 16), VisibleTiles::all(64, 32));
        let expected = [[0, 1, 0, 3], [1, 0, 0, 3], [1, 0, 1, 0]];
        assert_eq!(two[..3], expected, "two sizes");
    }

    #[test]
    fn rows_that_both_views_show_wholly_are_counted_from_the_middle() {
        let of = |left: &VisibleTiles, right: &VisibleTiles| {
            let views = [left.clone(), right.clone()];
            whole_rows(&views)
        };
        let all = VisibleTiles::all(250, 130);
        assert_eq!(of(&all, &all), [0, 8], "all nine");
        let mut upper = all.clone();
        upper.rows[1] = [0, 14];
        let mut lower = all.clone();
        lower.rows[7] = [1, 15];
        assert_eq!(of(&upper, &lower), [2, 6], "between those of either");
        lower.rows[4] = NONE;
        assert_eq!(of(&all, &lower), [1, 0], "the middle is not");
        let one = VisibleTiles::all(10, 10);
        assert_eq!(of(&one, &one), [0, 0], "one row");
    }
}
