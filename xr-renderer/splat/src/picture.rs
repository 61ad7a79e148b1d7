//! A picture on the host, and putting it over a backdrop.

/// What stands behind all Gaussians: no scene, but colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Backdrop {
    /// One display colour, 0..=1.
    Colour([f32; 3]),
    /// From the upper to the lower edge.
    Gradient {
        /// Display colour of the first row, 0..=1.
        top: [f32; 3],
        /// Display colour of the last row, 0..=1.
        bottom: [f32; 3],
    },
}

impl Backdrop {
    /// The colours of the upper and the lower edge.
    pub(crate) fn ends(self) -> ([f32; 3], [f32; 3]) {
        match self {
            Self::Colour(colour) => (colour, colour),
            Self::Gradient { top, bottom } => (top, bottom),
        }
    }

    /// The colour of a row.
    fn row(self, y: u32, height: u32) -> [f32; 3] {
        match self {
            Self::Colour(colour) => colour,
            Self::Gradient { top, bottom } => {
                #[expect(clippy::cast_precision_loss, reason = "rows are few")]
                let share = y as f32 / height.saturating_sub(1).max(1) as f32;
                std::array::from_fn(|channel| {
                    top[channel] + (bottom[channel] - top[channel]) * share
                })
            }
        }
    }
}

/// A picture of display values with premultiplied alpha, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<[f32; 4]>,
}

impl Image {
    /// A picture from its pixels; nothing if their number does not fit the size.
    pub fn new(width: u32, height: u32, pixels: Vec<[f32; 4]>) -> Option<Self> {
        let fits = u64::from(width) * u64::from(height) == pixels.len() as u64;
        fits.then_some(Self {
            width,
            height,
            pixels,
        })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Red, green, blue, alpha, premultiplied; row by row from the top.
    pub fn pixels(&self) -> &[[f32; 4]] {
        &self.pixels
    }

    /// Premultiplied RGBA in 8 bits; the colours are display values, so no transfer function is applied.
    pub fn to_rgba8(&self) -> Vec<u8> {
        self.pixels
            .iter()
            .flatten()
            .map(|value| to_u8(*value))
            .collect()
    }

    /// RGB in 8 bits over a backdrop.
    pub fn over(&self, backdrop: Backdrop) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.pixels.len() * 3);
        let width = self.width.max(1) as usize;
        for (y, row) in (0..).zip(self.pixels.chunks_exact(width)) {
            let behind = backdrop.row(y, self.height);
            for [red, green, blue, alpha] in row {
                let through = 1.0 - alpha;
                for (front, back) in [red, green, blue].into_iter().zip(behind) {
                    bytes.push(to_u8(front + through * back));
                }
            }
        }
        bytes
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to 0..=255 before; NaN becomes 0"
)]
fn to_u8(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn premultiplied_colour_over_a_backdrop_lets_the_rest_through() {
        let image = Image::new(1, 2, vec![[0.5, 0.0, 0.0, 0.5], [0.0; 4]]).expect("2 pixels");
        let top = [0.0, 1.0, 0.0];
        let bottom = [0.0, 0.0, 1.0];
        assert_eq!(
            image.over(Backdrop::Gradient { top, bottom }),
            [128, 128, 0, 0, 0, 255],
            "rows"
        );
    }

    #[test]
    fn a_picture_needs_as_many_pixels_as_its_size_says() {
        assert!(
            Image::new(2, 2, vec![[0.0; 4]; 3]).is_none(),
            "3 of 4 pixels"
        );
    }
}
