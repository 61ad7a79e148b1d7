//! One picture of the avatar against the photograph, and the means over a group of them.

use super::canvas::Canvas;
use super::psnr::{dilated, psnr};
use super::{frechet, ssim};
use anyhow::{Context, ensure};
use capture::Photograph;
use renderer_splat::picture::Image;
use serde::Serialize;

/// Pixels around the person's box that networks see as well.
const MARGIN: usize = 8;

/// A photograph and the avatar's picture of the same moment, both over black.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    /// The photograph's person.
    pub(super) truth: Canvas,
    /// What was drawn.
    pub(super) drawn: Canvas,
    /// The pixels of the dilated mask.
    counts: Vec<bool>,
}

/// How alike a pair is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Scores {
    /// Signal-to-noise ratio inside the dilated mask, dB.
    pub(super) psnr_masked: f64,
    /// The same over the whole picture: the more empty pixels, the higher.
    pub(super) psnr: f64,
    /// Mean structural similarity inside the dilated mask.
    pub(super) ssim_masked: f64,
    /// The same over the whole picture.
    pub(super) ssim: f64,
    /// LPIPS of the person's square, where a network was given.
    pub(super) lpips: Option<f64>,
}

/// The means over a group of pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Means {
    /// How many pictures.
    pub(super) pictures: usize,
    /// Mean scores; nothing of no picture.
    #[serde(flatten)]
    pub(super) scores: Option<Scores>,
    /// The Frechet inception distance, where a network was given and there are two pictures.
    pub(super) fid: Option<f64>,
}

impl Pair {
    /// Puts both over black; nothing where the mask is empty: the person is not in the picture.
    ///
    /// # Errors
    /// A photograph without a mask; pictures of different sizes.
    pub(super) fn new(photograph: &Photograph, drawn: &Image) -> anyhow::Result<Option<Self>> {
        let mask = (photograph.mask.as_ref()).context(
            "the capture has no masks: an avatar can be compared with a masked person only",
        )?;
        let truth = Canvas::of_photograph(photograph).context("a photograph without a mask")?;
        let drawn = Canvas::of_image(drawn);
        ensure!(
            truth.pixels.len() == drawn.pixels.len() && truth.width == drawn.width,
            "the photograph and the avatar's picture differ in size"
        );
        let counts = dilated(mask, truth.width);
        Ok(counts.contains(&true).then_some(Self {
            truth,
            drawn,
            counts,
        }))
    }

    /// How alike the two are, without what networks judge.
    pub(super) fn scores(&self) -> anyhow::Result<Scores> {
        let inside = |pixel: usize| self.counts[pixel];
        let similarity = ssim::map(&self.truth, &self.drawn);
        let mean = |counts: &dyn Fn(usize) -> bool| {
            let chosen = (similarity.iter().enumerate()).filter(|(pixel, _)| counts(*pixel));
            let (sum, count) = chosen.fold((0.0, 0.0), |(sum, count), (_, value)| {
                (sum + value, count + 1.0)
            });
            sum / count
        };
        Ok(Scores {
            psnr_masked: psnr(&self.truth, &self.drawn, inside).context("an empty mask")?,
            psnr: psnr(&self.truth, &self.drawn, |_| true).context("an empty picture")?,
            ssim_masked: mean(&inside),
            ssim: mean(&|_| true),
            lpips: None,
        })
    }

    /// The square `[left, top, side, side]` around the person, with a margin. It may reach beyond the picture's right and lower edge.
    pub(super) fn square(&self) -> [usize; 4] {
        let width = self.truth.width.max(1);
        let height = self.truth.height();
        let inside = (self.counts.iter().enumerate()).filter(|(_, inside)| **inside);
        let (mut low, mut high) = ([width, height], [0, 0]);
        for (pixel, _) in inside {
            for (axis, at) in [pixel % width, pixel / width].into_iter().enumerate() {
                low[axis] = low[axis].min(at);
                high[axis] = high[axis].max(at + 1);
            }
        }
        let extent = [0, 1].map(|axis| high[axis].saturating_sub(low[axis]));
        let side = extent[0].max(extent[1]) + 2 * MARGIN;
        let first = |axis: usize, length: usize| {
            let centred = (low[axis] + extent[axis] / 2).saturating_sub(side / 2);
            centred.min(length.saturating_sub(side))
        };
        [first(0, width), first(1, height), side, side]
    }
}

impl Means {
    /// Of every picture's scores, and of the features of truth and drawn where they are there.
    pub(super) fn of(scores: &[Scores], features: [&[Vec<f32>]; 2]) -> Self {
        let count = scores.len() as f64;
        let mean = |of: fn(&Scores) -> f64| scores.iter().map(of).sum::<f64>() / count;
        let lpips: Option<Vec<f64>> = scores.iter().map(|scores| scores.lpips).collect();
        Self {
            pictures: scores.len(),
            scores: (!scores.is_empty()).then(|| Scores {
                psnr_masked: mean(|scores| scores.psnr_masked),
                psnr: mean(|scores| scores.psnr),
                ssim_masked: mean(|scores| scores.ssim_masked),
                ssim: mean(|scores| scores.ssim),
                lpips: lpips.map(|values| values.iter().sum::<f64>() / count),
            }),
            fid: frechet::distance(features[0], features[1]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn photograph(size: [u32; 2], person: [u32; 4]) -> Photograph {
        let [left, top, width, height] = person;
        let pixels = || (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y)));
        let inside = |(x, y): (u32, u32)| {
            (left..left + width).contains(&x) && (top..top + height).contains(&y)
        };
        Photograph {
            size,
            rgb: pixels().flat_map(|_| [200, 100, 50]).collect(),
            mask: Some(
                pixels()
                    .map(|at| if inside(at) { 255 } else { 0 })
                    .collect(),
            ),
        }
    }

    #[test]
    fn what_is_far_from_the_person_counts_in_the_whole_picture_only() {
        let photograph = photograph([60, 50], [10, 10, 12, 20]);
        let mut pixels = vec![[0.0f32; 4]; 3000];
        for (pixel, mask) in pixels.iter_mut().zip(photograph.mask.iter().flatten()) {
            if *mask > 0 {
                *pixel = [200.0 / 255.0, 100.0 / 255.0, 50.0 / 255.0, 1.0];
            }
        }
        let score = |pixels: &[[f32; 4]]| {
            let image = Image::new(60, 50, pixels.to_vec()).expect("its size");
            let pair = Pair::new(&photograph, &image)
                .expect("a pair")
                .expect("a person");
            pair.scores().expect("scores")
        };
        let same = score(&pixels);
        assert!(same.psnr_masked > 100.0 && same.ssim > 0.9999, "{same:?}");
        // A speck in the far corner.
        pixels[49 * 60 + 59] = [1.0, 1.0, 1.0, 1.0];
        let speck = score(&pixels);
        assert!(speck.psnr_masked > 100.0, "{speck:?}");
        assert!(speck.psnr < 40.0, "{speck:?}");
        // And one beside the person, within the dilation.
        pixels[12 * 60 + 25] = [1.0, 1.0, 1.0, 1.0];
        assert!(
            score(&pixels).psnr_masked < 35.0,
            "what stands beside the person counts"
        );
    }

    #[test]
    fn the_square_holds_the_person() {
        for person in [[2, 3, 10, 30], [40, 1, 18, 5], [0, 0, 60, 50]] {
            let image = Image::new(60, 50, vec![[0.0; 4]; 3000]).expect("its size");
            let pair = Pair::new(&photograph([60, 50], person), &image);
            let pair = pair.expect("a pair").expect("a person");
            let [left, top, side, same] = pair.square();
            let [x, y, width, height] = person.map(|value| value as usize);
            assert_eq!(side, same, "a square");
            assert!(left <= x && top <= y, "{left}, {top} for {person:?}");
            assert!(
                left + side >= x + width && top + side >= y + height,
                "{person:?}"
            );
        }
    }

    #[test]
    fn a_picture_without_a_person_is_no_pair_and_one_without_a_mask_is_refused() {
        let image = Image::new(60, 50, vec![[0.0; 4]; 3000]).expect("its size");
        let empty = photograph([60, 50], [0, 0, 0, 0]);
        let nobody = Pair::new(&empty, &image).expect("a mask");
        assert!(nobody.is_none(), "an empty mask");
        let bare = Photograph {
            mask: None,
            ..photograph([60, 50], [1, 1, 5, 5])
        };
        assert!(Pair::new(&bare, &image).is_err(), "no mask");
        let other = photograph([50, 60], [1, 1, 5, 5]);
        assert!(Pair::new(&other, &image).is_err(), "another size");
    }
}
