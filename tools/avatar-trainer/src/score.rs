//! How near a drawn picture comes to a photograph of the person, within its mask. `eval avatar`'s masked PSNR looks at a margin around the mask
//! as well, so that the two are not the same figure.

use splat_gradient::Picture;
use splat_gradient::loss::Target;

/// Pixels whose mask is at least this are the person's.
pub(crate) const PERSON: f32 = 0.5;

/// Sums of squared differences over a person's pixels, of one picture or several.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Score {
    squares: f64,
    numbers: u64,
}

impl Score {
    /// Adds a picture: red, green and blue as display values, premultiplied, over the pixels that the photograph's mask gives to the
    /// person. Pictures of different sizes are compared as far as both go.
    pub fn add(&mut self, drawn: &Picture, target: &Target) {
        let wanted = target.picture();
        let mask = wanted.plane(3);
        for channel in 0..3 {
            let pixels = drawn.plane(channel).iter().zip(wanted.plane(channel));
            for ((drawn, wanted), mask) in pixels.zip(mask) {
                if *mask >= PERSON {
                    // What a display shows.
                    let shown = f64::from(drawn.clamp(0.0, 1.0));
                    self.squares += (shown - f64::from(*wanted)).powi(2);
                    self.numbers += 1;
                }
            }
        }
    }

    /// PSNR within the masks, decibels: of the mean of the squares over all pixels of the person, a range of 1. 0 where no pixel was the person's.
    #[must_use]
    pub fn psnr(&self) -> f64 {
        if self.numbers == 0 {
            return 0.0;
        }
        #[expect(clippy::cast_precision_loss, reason = "counts of pixels")]
        let mean = self.squares / self.numbers as f64;
        -10.0 * mean.max(1e-12).log10()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_persons_pixels_count() {
        // Two pixels: the person's is wrong by 0.1, the background's by 0.9.
        let drawn = Picture::new(2, 1, vec![0.6, 0.9, 0.6, 0.9, 0.6, 0.9, 1.0, 1.0]);
        let wanted = Picture::new(2, 1, vec![0.5, 0.0, 0.5, 0.0, 0.5, 0.0, 1.0, 0.0]);
        let mut score = Score::default();
        assert!(score.psnr().abs() < 1e-9, "nothing was seen");
        score.add(&drawn.expect("two"), &Target::new(wanted.expect("two")));
        let psnr = score.psnr();
        assert!((psnr - 20.0).abs() < 1e-4, "0.1 is 20 dB: {psnr}");
    }
}
