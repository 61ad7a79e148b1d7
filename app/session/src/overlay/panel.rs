//! The panel's pixels: a card, and text and bars on it.

use super::glyphs::Glyphs;
use super::layout::{Colour, Item, Rect, Shape, base_line};

pub(super) const CARD: Colour = [17, 20, 26];
/// How much of the card hides what is behind. Light is blended, not displayed values, so that a bright wall shines through much.
const CARD_OPACITY: f32 = 0.95;
/// Radius of its corners, pixels.
const CORNER: f32 = 28.0;

/// A picture to be hung in the room as a layer of its own.
///
/// RGBA, rows from the top. Colours are premultiplied for a compositor that blends light, as for pictures in a swapchain of an
/// sRGB format: a value is `encode(decode(colour) * alpha)`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Panel {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Four bytes for each.
    pub pixels: Vec<u8>,
}

/// An empty card with round corners.
pub(super) fn card(width: u32, height: u32) -> Panel {
    let pixel = |alpha: f32| {
        let [r, g, b] = CARD.map(|value| byte(encode(decode(value) * alpha)));
        [r, g, b, byte(alpha)]
    };
    let inside = pixel(CARD_OPACITY);
    let mut pixels = inside.repeat(width as usize * height as usize);
    let half = [width as f32 / 2.0, height as f32 / 2.0];
    for (k, place) in pixels.chunks_exact_mut(4).enumerate() {
        let at = [k % width as usize, k / width as usize];
        // Signed distance of the pixel's centre from the card's edge, which is smooth over one pixel.
        let beyond: [f32; 2] =
            std::array::from_fn(|k| (at[k] as f32 + 0.5 - half[k]).abs() - (half[k] - CORNER));
        let outside = beyond[0].max(0.0).hypot(beyond[1].max(0.0));
        let distance = outside + beyond[0].max(beyond[1]).min(0.0) - CORNER;
        if distance > -0.5 {
            place.copy_from_slice(&pixel(CARD_OPACITY * (0.5 - distance).max(0.0)));
        }
    }
    Panel {
        width,
        height,
        pixels,
    }
}

impl Panel {
    pub(super) fn draw(&mut self, item: &Item, glyphs: &mut Glyphs) {
        let Rect { x, y, .. } = item.place;
        match &item.shape {
            Shape::Fill(opacity) => self.fill(item.place, item.colour, *opacity),
            Shape::Text { size, text } => {
                let mut pen = x;
                for letter in text.chars() {
                    let glyph = glyphs.get(letter, *size);
                    let width = glyph.width.max(1) as usize;
                    for (row, line) in (0..).zip(glyph.coverage.chunks_exact(width)) {
                        for (column, coverage) in (0..).zip(line) {
                            let at = [
                                pen.saturating_add_signed(glyph.left + column),
                                (y + base_line(*size)).saturating_add_signed(glyph.top + row),
                            ];
                            self.cover(at, item.colour, *coverage);
                        }
                    }
                    pen += size.advance();
                }
            }
        }
    }

    fn fill(&mut self, place: Rect, colour: Colour, opacity: u8) {
        for y in place.y..place.y + place.height {
            for x in place.x..place.x + place.width {
                self.cover([x, y], colour, opacity);
            }
        }
    }

    /// Covers one pixel with an opaque colour, so much of 255.
    ///
    /// Between the card and the colour it goes evenly in displayed values: for light text on dark that keeps strokes as the
    /// font's makers drew them.
    fn cover(&mut self, [x, y]: [u32; 2], colour: Colour, coverage: u8) {
        if coverage == 0 || x >= self.width || y >= self.height {
            return;
        }
        let at = (y as usize * self.width as usize + x as usize) * 4;
        let Some(pixel) = self.pixels.get_mut(at..at + 4) else {
            return;
        };
        let (share, rest) = (u32::from(coverage), 255 - u32::from(coverage));
        for (value, over) in pixel.iter_mut().zip(colour.into_iter().chain([255])) {
            let mixed = (u32::from(*value) * rest + u32::from(over) * share + 127) / 255;
            *value = u8::try_from(mixed).unwrap_or(u8::MAX);
        }
    }
}

/// Light of a displayed value: the sRGB curve (IEC 61966-2-1).
fn decode(value: u8) -> f32 {
    let value = f32::from(value) / 255.0;
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}

/// The value that displays so much light.
fn encode(light: f32) -> f32 {
    if light <= 0.003_130_8 {
        light * 12.92
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    }
}

fn byte(share: f32) -> u8 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of 255"
    )]
    let byte = (share.clamp(0.0, 1.0) * 255.0).round() as u8;
    byte
}
