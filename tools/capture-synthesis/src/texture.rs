//! Textures as pyramids of ever smaller pictures (Williams, "Pyramidal Parametrics", 1983), so that a distant surface does not glitter.

use glam::{Vec2, Vec4};
use reconstruct::Texture;

/// One size of a texture: 8-bit display values and alpha, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
struct Level {
    size: [usize; 2],
    texels: Vec<[u8; 4]>,
}

/// A texture at all its sizes, each half of the one before.
#[derive(Debug, Clone, PartialEq)]
pub struct Pyramid {
    levels: Vec<Level>,
}

impl Level {
    /// Half the size; the colour is weighed by alpha, so that what is transparent does not darken an edge.
    fn half(&self) -> Self {
        let size = self.size.map(|side| (side / 2).max(1));
        let texel = |x: usize, y: usize| {
            let mut sum = [0u32; 4];
            let mut plain = [0u32; 3];
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let x = (2 * x + dx).min(self.size[0] - 1);
                let y = (2 * y + dy).min(self.size[1] - 1);
                let [r, g, b, a] = self.texels[y * self.size[0] + x].map(u32::from);
                for (k, value) in [r, g, b].into_iter().enumerate() {
                    sum[k] += value * a;
                    plain[k] += value;
                }
                sum[3] += a;
            }
            let alpha = sum[3];
            let colour = |k: usize| {
                (sum[k] + alpha / 2)
                    .checked_div(alpha)
                    .unwrap_or((plain[k] + 2) / 4)
            };
            [colour(0), colour(1), colour(2), (alpha + 2) / 4].map(byte)
        };
        let texels = (0..size[1])
            .flat_map(|y| (0..size[0]).map(move |x| (x, y)))
            .map(|(x, y)| texel(x, y))
            .collect();
        Self { size, texels }
    }

    /// Bilinear at `uv` (v up), 0..=255; beyond the border it continues.
    fn sample(&self, uv: Vec2) -> Vec4 {
        let [width, height] = self.size;
        let x = (uv.x * width as f32 - 0.5).clamp(0.0, (width - 1) as f32);
        let y = ((1.0 - uv.y) * height as f32 - 0.5).clamp(0.0, (height - 1) as f32);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the picture above"
        )]
        let (left, top) = (x as usize, y as usize);
        let at = |x: usize, y: usize| {
            let texel = self.texels[y.min(height - 1) * width + x.min(width - 1)];
            Vec4::from_array(texel.map(f32::from))
        };
        let (right, down) = (x - left as f32, y - top as f32);
        let above = at(left, top).lerp(at(left + 1, top), right);
        let below = at(left, top + 1).lerp(at(left + 1, top + 1), right);
        above.lerp(below, down)
    }
}

fn byte(value: u32) -> u8 {
    u8::try_from(value).unwrap_or(u8::MAX)
}

impl Pyramid {
    /// Takes texels `[height, width]`, row by row from the top: 8-bit display values and alpha, not premultiplied. Nothing for a picture
    /// without texels, or with another number of them than its size says.
    #[must_use]
    pub fn new(size: [usize; 2], texels: Vec<[u8; 4]>) -> Option<Self> {
        let count = size[0].checked_mul(size[1])?;
        if count == 0 || texels.len() != count {
            return None;
        }
        let mut levels = vec![Level { size, texels }];
        while let Some(last) = levels.last()
            && last.size != [1, 1]
        {
            let half = last.half();
            levels.push(half);
        }
        Some(Self { levels })
    }

    /// Of a person's texture; nothing for an empty one.
    #[must_use]
    pub fn of(texture: &Texture) -> Option<Self> {
        let [width, height] = texture.size();
        let texels = (texture.texels().iter())
            .map(|texel| {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "clamped to 0..=255"
                )]
                let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
                texel.to_array().map(byte)
            })
            .collect();
        Self::new([width, height], texels)
    }

    /// Width and height at full size, texels.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        self.levels[0].size
    }

    /// Colour and alpha (0..=1) at `uv` (v up), blended between the two sizes next to `level`: 0 is the full size, 1 half of it.
    #[must_use]
    pub fn sample(&self, uv: Vec2, level: f32) -> Vec4 {
        let last = self.levels.len() - 1;
        let level = if level.is_finite() { level } else { 0.0 };
        let level = level.clamp(0.0, last as f32);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the levels above"
        )]
        let finer = level as usize;
        let share = level - finer as f32;
        let texel = self.levels[finer].sample(uv);
        let texel = if share > 0.0 {
            texel.lerp(self.levels[(finer + 1).min(last)].sample(uv), share)
        } else {
            texel
        };
        texel / 255.0
    }
}
