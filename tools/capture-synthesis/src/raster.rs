//! Which triangle is seen at each sample of a picture, and where on it: a z-buffer over a regular grid of samples.
//!
//! Edges are tested in integers, so that two triangles with a common edge neither leave a gap nor share a sample: corners lie on a grid of
//! 1/256 sample, and a sample on an edge belongs to one side by a rule on the edge's direction. Attributes are interpolated
//! perspective-correctly (Heckbert and Moreton, "Interpolation for Polygon Texture Mapping and Shading", 1991). Nothing here knows of
//! colours.

use std::ops::Range;

/// Samples along each side of a pixel: 4 x 4 a pixel.
pub const SAMPLES: usize = 4;

/// Steps of the grid of corners between two samples.
const SUBSTEPS: f64 = 256.0;

/// The largest coordinate of a corner, samples: the integers of the edge tests stay far below 64 bits.
const MOST: f64 = 1e6;

/// A corner of a triangle on the sample grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// From the left edge, in samples.
    pub x: f64,
    /// From the top edge, in samples.
    pub y: f64,
    /// 1 / distance along the camera's axis for a perspective view, 1 for an orthographic one.
    pub inverse_w: f32,
    /// Grows towards the viewer, and is linear in the picture: 1 / distance in a perspective view, a height in an orthographic one.
    pub nearness: f32,
}

/// What is seen at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// As [`Corner::nearness`]; negative infinity where nothing is.
    pub nearness: f32,
    /// Index of the triangle; `u32::MAX` where nothing is.
    pub face: u32,
    /// Perspective-correct shares of the triangle's second and third corner.
    pub shares: [f32; 2],
}

impl Sample {
    /// Nothing is seen.
    pub const EMPTY: Self = Self {
        nearness: f32::NEG_INFINITY,
        face: u32::MAX,
        shares: [0.0; 2],
    };

    /// Whether a triangle is seen here.
    #[must_use]
    pub fn is_covered(&self) -> bool {
        self.face != u32::MAX
    }
}

/// A triangle with its edge functions.
#[derive(Debug, Clone)]
struct Facet {
    face: u32,
    /// Corners on the integer grid, so ordered that the area is positive.
    at: [[i64; 2]; 3],
    /// Twice the area.
    area: i64,
    /// Of the ordered corners.
    inverse_w: [f32; 3],
    nearness: [f32; 3],
    /// Whether the second and the third corner were exchanged for the order.
    turned: bool,
    /// Samples that may be inside: columns and rows.
    columns: Range<usize>,
    rows: Range<usize>,
}

/// Triangles set up for one picture.
#[derive(Debug, Clone)]
pub struct Facets {
    facets: Vec<Facet>,
    /// Indices of the facets that reach into each band of rows, in order.
    bands: Vec<Vec<u32>>,
    size: [usize; 2],
    rows_in_band: usize,
}

/// Twice the area of the triangle `a`, `b`, `p`: positive on one side of the edge.
fn edge(a: [i64; 2], b: [i64; 2], p: [i64; 2]) -> i64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

/// Whether samples on the edge from `a` to `b` are inside. Two neighbours pass a common edge in opposite directions: it is true for one.
fn owns(a: [i64; 2], b: [i64; 2]) -> bool {
    b[1] > a[1] || (b[1] == a[1] && b[0] > a[0])
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "bounded by MOST, or by the picture's size"
)]
fn grid(at: f64) -> i64 {
    (at * SUBSTEPS).round() as i64
}

/// The samples whose centres (at 0.5, 1.5, ...) lie between two coordinates, cut to `0..side`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to 0..=side first"
)]
fn span(low: i64, high: i64, side: usize) -> Range<usize> {
    let bound = |at: f64| at.clamp(0.0, side as f64) as usize;
    let (low, high) = (low as f64 / SUBSTEPS, high as f64 / SUBSTEPS);
    bound((low - 0.5).ceil())..bound((high - 0.5).floor() + 1.0)
}

impl Facet {
    fn new(face: u32, corners: [Corner; 3], size: [usize; 2]) -> Option<Self> {
        let sound = |c: &Corner| {
            c.x.abs() < MOST
                && c.y.abs() < MOST
                && c.inverse_w.is_finite()
                && c.nearness.is_finite()
        };
        if !corners.iter().all(sound) {
            return None;
        }
        let mut order = [0, 1, 2];
        let mut at = corners.map(|c| [grid(c.x), grid(c.y)]);
        let mut area = edge(at[0], at[1], at[2]);
        let turned = area < 0;
        if turned {
            order.swap(1, 2);
            at.swap(1, 2);
            area = -area;
        }
        if area == 0 {
            return None;
        }
        let bounds = |axis: usize| {
            let values = at.map(|p| p[axis]);
            let low = values[0].min(values[1]).min(values[2]);
            let high = values[0].max(values[1]).max(values[2]);
            span(low, high, size[axis])
        };
        let (columns, rows) = (bounds(0), bounds(1));
        (!columns.is_empty() && !rows.is_empty()).then(|| Self {
            face,
            at,
            area,
            inverse_w: order.map(|k| corners[k].inverse_w),
            nearness: order.map(|k| corners[k].nearness),
            turned,
            columns,
            rows,
        })
    }

    /// Draws the part within `rows` into `samples`, the samples of those rows.
    fn draw(
        &self,
        rows: Range<usize>,
        width: usize,
        samples: &mut [Sample],
        keep: &impl Fn(usize, usize, &Sample) -> bool,
    ) {
        let [a, b, c] = self.at;
        let edges = [(b, c), (c, a), (a, b)];
        // An edge that does not own its samples needs a positive value: at least 1.
        let least = edges.map(|(from, to)| i64::from(!owns(from, to)));
        #[expect(clippy::cast_possible_truncation, reason = "exactly 256")]
        let step = SUBSTEPS as i64;
        let slope_x = edges.map(|(from, to)| (from[1] - to[1]) * step);
        let inverse_area = 1.0 / self.area as f64;
        for y in rows.start.max(self.rows.start)..rows.end.min(self.rows.end) {
            let first = [self.columns.start, y].map(|k| k as i64 * step + step / 2);
            let mut values = edges.map(|(from, to)| edge(from, to, first));
            let row = &mut samples[(y - rows.start) * width..][..width];
            for x in self.columns.clone() {
                let inside = (0..3).all(|k| values[k] >= least[k]);
                if inside {
                    #[expect(clippy::cast_possible_truncation, reason = "shares of 0..=1")]
                    let [u, v, w] = values.map(|value| (value as f64 * inverse_area) as f32);
                    let [na, nb, nc] = self.nearness;
                    let nearness = u * na + v * nb + w * nc;
                    if nearness > row[x].nearness {
                        let [wa, wb, wc] = self.inverse_w;
                        let (wa, wb, wc) = (u * wa, v * wb, w * wc);
                        let sum = wa + wb + wc;
                        let (second, third) = (wb / sum, wc / sum);
                        let sample = Sample {
                            nearness,
                            face: self.face,
                            shares: if self.turned {
                                [third, second]
                            } else {
                                [second, third]
                            },
                        };
                        if keep(x, y, &sample) {
                            row[x] = sample;
                        }
                    }
                }
                for (value, slope) in values.iter_mut().zip(slope_x) {
                    *value += slope;
                }
            }
        }
    }
}

impl Facets {
    /// Sets up triangles for a grid of `size` samples (columns, rows), to be drawn in bands of `rows_in_band` rows of samples (at least 1).
    ///
    /// `corners` gives a triangle's corners by its index; a triangle without is not drawn, nor is one that has no area on the grid.
    #[must_use]
    pub fn new(
        faces: usize,
        corners: impl Fn(usize) -> Option<[Corner; 3]>,
        size: [usize; 2],
        rows_in_band: usize,
    ) -> Self {
        let rows_in_band = rows_in_band.max(1);
        let facets: Vec<Facet> = (0u32..)
            .zip(0..faces)
            .filter_map(|(face, index)| Facet::new(face, corners(index)?, size))
            .collect();
        let mut bands = vec![Vec::new(); size[1].div_ceil(rows_in_band)];
        for (index, facet) in (0u32..).zip(&facets) {
            let (first, last) = (
                facet.rows.start / rows_in_band,
                (facet.rows.end - 1) / rows_in_band,
            );
            for band in &mut bands[first..=last] {
                band.push(index);
            }
        }
        Self {
            facets,
            bands,
            size,
            rows_in_band,
        }
    }

    /// How many bands cover the picture.
    #[must_use]
    pub fn bands(&self) -> usize {
        self.bands.len()
    }

    /// The rows of samples of a band.
    #[must_use]
    pub fn rows(&self, band: usize) -> Range<usize> {
        let first = band * self.rows_in_band;
        first..(first + self.rows_in_band).min(self.size[1])
    }

    /// What is seen at the samples of a band, row by row: the nearest triangle, of equally near ones the first.
    ///
    /// `keep` is asked, by the sample's column and row, whether a triangle is opaque there; it must answer the same whenever it is asked.
    pub fn draw(
        &self,
        band: usize,
        samples: &mut Vec<Sample>,
        keep: impl Fn(usize, usize, &Sample) -> bool,
    ) {
        let (rows, width) = (self.rows(band), self.size[0]);
        samples.clear();
        samples.resize(rows.len() * width, Sample::EMPTY);
        for index in &self.bands[band] {
            self.facets[*index as usize].draw(rows.clone(), width, samples, &keep);
        }
    }
}
