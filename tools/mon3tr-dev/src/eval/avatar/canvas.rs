//! Pictures as they are compared: display values over black.

use capture::Photograph;
use renderer_splat::picture::Image;

/// Red, green and blue display values (0..=1) over black, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Canvas {
    /// Pixels of a row.
    pub(super) width: usize,
    /// Row by row.
    pub(super) pixels: Vec<[f32; 3]>,
}

impl Canvas {
    /// From the pixels of whole rows.
    pub(super) fn new(width: usize, pixels: Vec<[f32; 3]>) -> Self {
        Self { width, pixels }
    }

    /// The person of a photograph over black: its colours times its mask; nothing without a mask.
    pub(super) fn of_photograph(photograph: &Photograph) -> Option<Self> {
        let mask = photograph.mask.as_ref()?;
        let pixels = (photograph.rgb.chunks_exact(3).zip(mask))
            .map(|(rgb, mask)| {
                let share = f32::from(*mask) / 255.0;
                [rgb[0], rgb[1], rgb[2]].map(|value| f32::from(value) / 255.0 * share)
            })
            .collect();
        Some(Self::new(photograph.size[0] as usize, pixels))
    }

    /// What the renderer drew, which is premultiplied, over black; in steps of 8 bits as a display has them.
    pub(super) fn of_image(image: &Image) -> Self {
        let pixels = (image.pixels().iter())
            .map(|[red, green, blue, _]| {
                [*red, *green, *blue].map(|value| (value.clamp(0.0, 1.0) * 255.0).round() / 255.0)
            })
            .collect();
        Self::new(image.width() as usize, pixels)
    }

    /// Rows.
    pub(super) fn height(&self) -> usize {
        self.pixels.len() / self.width.max(1)
    }

    /// One channel, row by row.
    pub(super) fn plane(&self, channel: usize) -> Vec<f64> {
        (self.pixels.iter())
            .map(|pixel| f64::from(pixel[channel]))
            .collect()
    }

    /// The part `[left, top, width, height]`, resampled to another size: each new pixel is the mean of the pixels under it, or bilinear
    /// between them where the part is enlarged.
    pub(super) fn resampled(&self, part: [usize; 4], size: [usize; 2]) -> Self {
        let [left, top, width, height] = part;
        let columns = weights(left, width, size[0], self.width);
        let rows = weights(top, height, size[1], self.height());
        let mut pixels = Vec::with_capacity(size[0] * size[1]);
        for row in &rows {
            for column in &columns {
                let mut sum = [0.0f32; 3];
                for (y, share_y) in row {
                    for (x, share_x) in column {
                        let pixel = self.pixels[y * self.width + x];
                        for (sum, value) in sum.iter_mut().zip(pixel) {
                            *sum += value * share_x * share_y;
                        }
                    }
                }
                pixels.push(sum);
            }
        }
        Self::new(size[0], pixels)
    }
}

/// Which pixels make each of `to` new ones of the `from` pixels after `first`, and their shares: a triangle filter as wide as the scale, at
/// least a pixel. Indices are kept below `limit`.
fn weights(first: usize, from: usize, to: usize, limit: usize) -> Vec<Vec<(usize, f32)>> {
    let scale = from as f64 / to.max(1) as f64;
    let reach = scale.max(1.0);
    (0..to)
        .map(|k| {
            let centre = first as f64 + (k as f64 + 0.5) * scale;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to the picture"
            )]
            let bound = |at: f64| at.clamp(0.0, limit.saturating_sub(1) as f64) as usize;
            let (low, high) = (bound(centre - reach), bound(centre + reach));
            let weight = |x: usize| (1.0 - (x as f64 + 0.5 - centre).abs() / reach).max(0.0);
            let sum: f64 = (low..=high).map(weight).sum();
            #[expect(clippy::cast_possible_truncation, reason = "a share")]
            let share = |x: usize| (weight(x) / sum.max(1e-9)) as f32;
            (low..=high).map(|x| (x, share(x))).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp_at_another_size() {
        let ramp = |width: u8| -> Canvas {
            let pixels = (0..width)
                .map(|x| [(f32::from(x) + 0.5) / f32::from(width); 3])
                .collect();
            Canvas::new(usize::from(width), pixels)
        };
        for (from, to) in [(64u8, 16u8), (16, 64), (30, 30)] {
            let resampled =
                ramp(from).resampled([0, 0, usize::from(from), 1], [usize::from(to), 1]);
            let margin = usize::from(to) / 8 + 1;
            let wanted = ramp(to);
            let inner = margin..usize::from(to) - margin;
            for (a, b) in resampled.pixels[inner.clone()]
                .iter()
                .zip(&wanted.pixels[inner])
            {
                assert!(
                    (a[0] - b[0]).abs() < 2e-3,
                    "{from} to {to}: {a:?}, not {b:?}"
                );
            }
        }
    }

    #[test]
    fn a_photographs_person_stands_over_black() {
        let photograph = Photograph {
            size: [2, 1],
            rgb: vec![255, 102, 51, 200, 200, 200],
            mask: Some(vec![255, 0]),
        };
        let canvas = Canvas::of_photograph(&photograph).expect("a mask");
        assert_eq!(canvas.pixels, [[1.0, 0.4, 0.2], [0.0; 3]], "over black");
        let bare = Photograph {
            mask: None,
            ..photograph
        };
        assert!(Canvas::of_photograph(&bare).is_none(), "no mask");
    }
}
