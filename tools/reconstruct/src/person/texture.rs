//! A texture: 8-bit sRGB with alpha, sampled in UV space.

use crate::ReconstructError;
use crate::makehuman::read_texture;
use glam::{Vec2, Vec3, Vec4};
use image::RgbaImage;
use std::path::Path;

/// Texels that transparent borders are filled from, outwards: twice the widest seam.
const BLEED: usize = 6;

/// Cloth darker than this in every channel was left unpainted.
const UNPAINTED: f32 = 0.11;

/// Texels that unpainted cloth is filled from, outwards.
const LINING: usize = 48;

/// An RGBA image with colour bled past its transparent borders, so that seams do not show the background.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    width: usize,
    height: usize,
    texels: Vec<Vec4>,
}

impl Texture {
    /// Reads a PNG or JPEG file.
    ///
    /// # Errors
    /// If the file cannot be read or is not an image.
    pub fn read(path: &Path) -> Result<Self, ReconstructError> {
        read_texture(path).map(|image| Self::new(&image))
    }

    /// Takes an image; colour in 0..=1, not linearised, alpha not premultiplied.
    #[must_use]
    pub fn new(image: &RgbaImage) -> Self {
        let texels = image
            .pixels()
            .map(|p| Vec4::from_array(p.0.map(|v| f32::from(v) / 255.0)))
            .collect();
        let mut texture = Self {
            width: image.width() as usize,
            height: image.height() as usize,
            texels,
        };
        texture.bleed(|texel| texel.w > 0.02, BLEED);
        texture
    }

    /// Width and height, texels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// `[height, width]` colour and alpha, 0..=1, row by row from the top.
    #[must_use]
    pub fn texels(&self) -> &[Vec4] {
        &self.texels
    }

    /// The texture with what is nearly black filled in from around it: for cloth whose hidden lining was never painted.
    #[must_use]
    pub fn with_lining(mut self) -> Self {
        self.bleed(|texel| texel.truncate().max_element() > UNPAINTED, LINING);
        self
    }

    /// Gives texels that are not `painted` the mean colour of painted neighbours, so many rings far; alpha stays.
    fn bleed(&mut self, painted: impl Fn(&Vec4) -> bool, rings: usize) {
        let mut known: Vec<bool> = self.texels.iter().map(painted).collect();
        for _ in 0..rings {
            let mut filled = Vec::new();
            for at in (0..self.texels.len()).filter(|at| !known[*at]) {
                let mut sum = Vec4::ZERO;
                for near in self.neighbours(at).filter(|n| known[*n]) {
                    sum += self.texels[near].truncate().extend(1.0);
                }
                if sum.w > 0.0 {
                    filled.push((at, sum.truncate() / sum.w));
                }
            }
            for (at, colour) in filled {
                self.texels[at] = colour.extend(self.texels[at].w);
                known[at] = true;
            }
        }
    }

    fn neighbours(&self, at: usize) -> impl Iterator<Item = usize> {
        let (x, y) = (at % self.width, at / self.width);
        let (width, height) = (self.width, self.height);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |r| {
            (x.saturating_sub(1)..(x + 2).min(width)).map(move |c| r * width + c)
        })
    }

    /// Colour and alpha at `uv` (v up), bilinear; outside 0..=1 the border continues.
    #[must_use]
    pub fn sample(&self, uv: Vec2) -> Vec4 {
        if self.texels.is_empty() {
            return Vec4::ONE;
        }
        let x = (uv.x * self.width as f32 - 0.5).clamp(0.0, (self.width - 1) as f32);
        let y = ((1.0 - uv.y) * self.height as f32 - 0.5).clamp(0.0, (self.height - 1) as f32);
        let (fx, fy) = (x.fract(), y.fract());
        #[allow(
            clippy::cast_possible_truncation,
            reason = "clamped to the image above"
        )]
        let (x0, y0) = (x as usize, y as usize);
        let at = |x: usize, y: usize| {
            self.texels[y.min(self.height - 1) * self.width + x.min(self.width - 1)]
        };
        let top = at(x0, y0).lerp(at(x0 + 1, y0), fx);
        let bottom = at(x0, y0 + 1).lerp(at(x0 + 1, y0 + 1), fx);
        top.lerp(bottom, fy)
    }

    /// Alpha-weighted mean colour, and mean alpha, of 3 x 3 samples of the cell between four corners' coordinates.
    #[must_use]
    pub(super) fn mean(&self, corner: impl Fn(f32, f32) -> Vec2) -> (Vec3, f32) {
        let mut sum = Vec3::ZERO;
        let mut plain = Vec3::ZERO;
        let mut alpha = 0.0;
        for k in 0..9 {
            let (u, v) = ((k % 3) as f32, (k / 3) as f32);
            let texel = self.sample(corner((u + 0.5) / 3.0, (v + 0.5) / 3.0));
            sum += texel.truncate() * texel.w;
            plain += texel.truncate();
            alpha += texel.w;
        }
        let colour = if alpha > 1e-3 {
            sum / alpha
        } else {
            plain / 9.0
        };
        (colour, alpha / 9.0)
    }
}
