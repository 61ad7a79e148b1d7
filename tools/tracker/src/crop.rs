//! A square region of a picture, turned about its centre, as a network's input.
//!
//! Pixels' centres are at halves (0.5, 1.5, ...) in the picture and in the input, so that a landmark goes back through the same
//! affine map that its input came by.

use crate::picture::PictureView;
use glam::{Affine2, Vec2};

/// Longer sides and farther centres are refused: single precision would no longer tell neighbouring pixels apart.
const LIMIT: f32 = 1e6;

/// A square in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    centre: Vec2,
    side: f32,
    radians: f32,
}

impl Region {
    /// The square of `side` pixels about `centre`, its axes turned by `radians` clockwise as one looks at the picture; nothing if a
    /// number is not finite, or the side is not above zero, or any is out of all bounds.
    #[must_use]
    pub fn new(centre: Vec2, side: f32, radians: f32) -> Option<Self> {
        let sane = centre.is_finite()
            && centre.abs().max_element() <= LIMIT
            && side > 1e-3
            && side <= LIMIT
            && radians.is_finite();
        sane.then_some(Self {
            centre,
            side,
            radians,
        })
    }

    /// The smallest square about the whole picture.
    #[must_use]
    pub fn whole(picture: PictureView<'_>) -> Option<Self> {
        let size = Vec2::new(picture.width() as f32, picture.height() as f32);
        Self::new(size * 0.5, size.max_element(), 0.0)
    }

    /// Its centre, pixels.
    #[must_use]
    pub fn centre(&self) -> Vec2 {
        self.centre
    }

    /// Its side, pixels.
    #[must_use]
    pub fn side(&self) -> f32 {
        self.side
    }

    /// How far it is turned, radians, clockwise as one looks at the picture.
    #[must_use]
    pub fn radians(&self) -> f32 {
        self.radians
    }

    /// From the region's own coordinates (0..1 from its left and its top) to the picture's pixels.
    #[must_use]
    pub fn picture_from_region(&self) -> Affine2 {
        Affine2::from_scale_angle_translation(Vec2::splat(self.side), self.radians, self.centre)
            * Affine2::from_translation(Vec2::splat(-0.5))
    }

    /// From the picture's pixels to the region's own coordinates.
    #[must_use]
    pub fn region_from_picture(&self) -> Affine2 {
        self.picture_from_region().inverse()
    }
}

/// What lies beyond a picture's edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Border {
    /// Black.
    Zero,
    /// The edge's pixel, repeated.
    Replicate,
}

/// How a region becomes numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crop {
    /// Pixels along the input's side.
    pub size: usize,
    /// Beyond the picture.
    pub border: Border,
    /// What black becomes.
    pub black: f32,
    /// What white becomes.
    pub white: f32,
}

impl Crop {
    /// Samples `region` of `picture` bilinearly into `planes`: red, green and blue, each `size` x `size`, row after row. Does nothing
    /// if `planes` has another length.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "inputs and pictures are far smaller than 2^24 pixels a side; casts from float to integer saturate"
    )]
    pub fn fill(&self, picture: PictureView<'_>, region: &Region, planes: &mut [f32]) {
        let area = self.size * self.size;
        if self.size == 0 || planes.len() != 3 * area {
            return;
        }
        let (red, rest) = planes.split_at_mut(area);
        let (green, blue) = rest.split_at_mut(area);
        let rows = red
            .chunks_exact_mut(self.size)
            .zip(green.chunks_exact_mut(self.size))
            .zip(blue.chunks_exact_mut(self.size));

        let step = region.side / self.size as f32;
        let along = Vec2::from_angle(region.radians) * step;
        let down = along.perp();
        let half = (self.size as f32 - 1.0) * 0.5;
        // Where a pixel's centre is at a whole number.
        let first = region.centre - Vec2::splat(0.5) - (along + down) * half;
        let scale = (self.white - self.black) / 255.0;
        let sampler = Sampler {
            picture,
            border: self.border,
        };

        for (row, ((red, green), blue)) in rows.enumerate() {
            let start = first + down * row as f32;
            let inside = sampler.inside(start, along, self.size);
            for (column, ((red, green), blue)) in
                red.iter_mut().zip(green).zip(blue.iter_mut()).enumerate()
            {
                let at = start + along * column as f32;
                let colour = if inside.contains(&column) {
                    // Nothing below zero is inside: truncation is the floor.
                    sampler.between_four(at, at.x as usize, at.y as usize)
                } else {
                    None
                };
                let [r, g, b] = colour.unwrap_or_else(|| sampler.near_the_edge(at));
                *red = r * scale + self.black;
                *green = g * scale + self.black;
                *blue = b * scale + self.black;
            }
        }
    }
}

/// Bilinear samples of a picture, at coordinates where a pixel's centre is at a whole number.
struct Sampler<'a> {
    picture: PictureView<'a>,
    border: Border,
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "pictures are far smaller than 2^24 pixels a side; casts from float to integer saturate"
)]
impl Sampler<'_> {
    /// Columns whose samples lie between four pixels of the picture: those of `start + column * along`, short of one at each end
    /// for rounding.
    fn inside(&self, start: Vec2, along: Vec2, columns: usize) -> std::ops::Range<usize> {
        let (mut from, mut to) = (0.0_f32, columns as f32);
        let last = [
            self.picture.width() as f32 - 1.0,
            self.picture.height() as f32 - 1.0,
        ];
        for ((start, along), last) in start.to_array().into_iter().zip(along.to_array()).zip(last) {
            if along.abs() < 1e-6 {
                if start < 0.0 || start >= last - 0.01 {
                    return 0..0;
                }
                continue;
            }
            let (a, b) = (-start / along, (last - start) / along);
            from = from.max(a.min(b) + 1.0);
            to = to.min(a.max(b) - 1.0);
        }
        if to <= from {
            return 0..0;
        }
        from.ceil() as usize..to.floor() as usize
    }

    /// The colour at `at`, 0..=255 a channel, between the pixel in column `x` and row `y` and those right of it and below.
    #[inline]
    fn between_four(&self, at: Vec2, x: usize, y: usize) -> Option<[f32; 3]> {
        let (fx, fy) = (at.x - x as f32, at.y - y as f32);
        let stride = self.picture.width() * 3;
        let first = y * stride + x * 3;
        let rgb = self.picture.rgb();
        let top: &[u8; 6] = rgb.get(first..first + 6)?.try_into().ok()?;
        let first = first + stride;
        let bottom: &[u8; 6] = rgb.get(first..first + 6)?.try_into().ok()?;
        let mut colour = [0.0; 3];
        for (channel, value) in colour.iter_mut().enumerate() {
            let mix = |row: &[u8; 6]| {
                let (left, right) = (f32::from(row[channel]), f32::from(row[channel + 3]));
                left + (right - left) * fx
            };
            let (top, bottom) = (mix(top), mix(bottom));
            *value = top + (bottom - top) * fy;
        }
        Some(colour)
    }

    /// The colour at `at`, 0..=255 a channel, wherever it is.
    #[inline(never)]
    fn near_the_edge(&self, at: Vec2) -> [f32; 3] {
        let (width, height) = (self.picture.width(), self.picture.height());
        let last = Vec2::new(width as f32 - 1.0, height as f32 - 1.0);
        if self.border == Border::Zero {
            if at.min_element() <= -1.0 || (at - last).max_element() >= 1.0 {
                return [0.0; 3];
            }
        } else if width > 1 && height > 1 {
            // Between repeated pixels the colour is that of the edge.
            let at = at.clamp(Vec2::ZERO, last);
            let (x, y) = (at.x as usize, at.y as usize);
            let colour = self.between_four(at, x.min(width - 2), y.min(height - 2));
            if let Some(colour) = colour {
                return colour;
            }
        }
        let floor = at.floor();
        let fraction = at - floor;
        let (x, y) = (floor.x as i64, floor.y as i64);
        let mut colour = [0.0; 3];
        for (dx, dy, weight) in [
            (0, 0, (1.0 - fraction.x) * (1.0 - fraction.y)),
            (1, 0, fraction.x * (1.0 - fraction.y)),
            (0, 1, (1.0 - fraction.x) * fraction.y),
            (1, 1, fraction.x * fraction.y),
        ] {
            if let Some(pixel) = self.pixel(x.saturating_add(dx), y.saturating_add(dy)) {
                for (sum, value) in colour.iter_mut().zip(pixel) {
                    *sum += weight * f32::from(*value);
                }
            }
        }
        colour
    }

    fn pixel(&self, x: i64, y: i64) -> Option<&[u8]> {
        let within = |at: i64, length: usize| {
            let last = i64::try_from(length).ok()? - 1;
            let at = match self.border {
                Border::Zero if at < 0 || at > last => return None,
                Border::Zero => at,
                Border::Replicate => at.clamp(0, last),
            };
            usize::try_from(at).ok()
        };
        let (width, height) = (self.picture.width(), self.picture.height());
        let first = (within(y, height)? * width + within(x, width)?) * 3;
        self.picture.rgb().get(first..first + 3)
    }
}
/// The box about `points` whose sides are turned by `radians`: its centre, and its size along its own sides. Infinite without points.
pub(crate) fn turned_box(points: impl IntoIterator<Item = Vec2>, radians: f32) -> (Vec2, Vec2) {
    let back = Vec2::from_angle(-radians);
    let none = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    let (low, high) = points
        .into_iter()
        .map(|point| back.rotate(point))
        .fold(none, |(low, high), p| (low.min(p), high.max(p)));
    let centre = Vec2::from_angle(radians).rotate((low + high) * 0.5);
    (centre, high - low)
}
