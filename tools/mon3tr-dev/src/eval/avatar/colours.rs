//! Each camera's colours: real cameras differ in white balance and exposure, which is the capture's and no part of an avatar.

use super::compare::Pair;
use super::draw;
use super::groups::spread;
use anyhow::Context;
use capture::Capture;
use mon3tr::stills::StillRenderer;
use nalgebra::Matrix3;
use spmm3::MotionParams;

/// Pictures that are looked at of each camera.
const PICTURES: usize = 6;

/// A matrix for each camera that brings what is drawn to its photographs' colours; none leaves colours as they are. Black stays black.
#[derive(Debug, Default)]
pub(super) struct Colours(Vec<Matrix3<f64>>);

impl Colours {
    /// By least squares over the people's pixels of some pictures of each camera, all of them of frames that are trained on.
    pub(super) fn fitted(
        renderer: &StillRenderer<'_>,
        capture: &Capture,
        motions: &[MotionParams],
    ) -> anyhow::Result<Self> {
        let frames = capture.held_out().kept_frames(capture.frames());
        let mut fits = vec![Fit::default(); capture.cameras().len()];
        for (camera, fit) in fits.iter_mut().enumerate() {
            let pictures = spread(&[camera], &frames, PICTURES);
            draw::draw(renderer, capture, motions, &pictures, |k, image| {
                let (camera, frame) = pictures[k];
                let pair = || Pair::new(&capture.photograph(camera, frame)?, image);
                let name = || format!("camera {}", capture.cameras()[camera].name);
                if let Some(pair) = pair().with_context(name)? {
                    fit.add(&pair);
                }
                Ok(())
            })?;
        }
        Ok(Self(fits.iter().map(Fit::solved).collect()))
    }

    /// Corrects what was drawn for a camera.
    pub(super) fn apply(&self, camera: usize, pair: &mut Pair) {
        let Some(matrix) = self.0.get(camera) else {
            return;
        };
        for pixel in &mut pair.drawn.pixels {
            let corrected = matrix * nalgebra::Vector3::from(pixel.map(f64::from));
            #[expect(clippy::cast_possible_truncation, reason = "display values")]
            let shown = [0, 1, 2].map(|k| corrected[k].clamp(0.0, 1.0) as f32);
            *pixel = shown;
        }
    }
}

/// The sums of one camera's least squares.
#[derive(Debug, Clone, Default)]
struct Fit {
    /// Of photograph times drawn, and of drawn times drawn.
    mixed: Matrix3<f64>,
    drawn: Matrix3<f64>,
}

impl Fit {
    fn add(&mut self, pair: &Pair) {
        for (truth, drawn) in pair.truth.pixels.iter().zip(&pair.drawn.pixels) {
            // Where one of them is empty, the outlines differ, not the colours.
            if *truth == [0.0; 3] || *drawn == [0.0; 3] {
                continue;
            }
            let [truth, drawn] =
                [truth, drawn].map(|of| nalgebra::Vector3::from(of.map(f64::from)));
            self.mixed += truth * drawn.transpose();
            self.drawn += drawn * drawn.transpose();
        }
    }

    /// Nothing is changed of a camera that saw nobody, or one colour alone.
    fn solved(&self) -> Matrix3<f64> {
        (self.drawn.try_inverse()).map_or_else(Matrix3::identity, |inverse| self.mixed * inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::super::canvas::Canvas;
    use super::*;
    use capture::Photograph;
    use renderer_splat::picture::Image;

    #[test]
    fn a_cameras_tint_is_found_and_taken_away() {
        let (width, height) = (16_u32, 8_u32);
        let drawn: Vec<[f32; 4]> = (0..128u8)
            .map(|k| match k {
                0..=15 => [0.0; 4],
                _ => [k, k.wrapping_mul(37) % 120, k.wrapping_mul(91) % 110, 255]
                    .map(|value| f32::from(value) / 255.0),
            })
            .collect();
        // Warmer, a little of green in red.
        let tinted = |[r, g, b, _]: [f32; 4]| [1.1 * r + 0.05 * g, 0.95 * g, 0.8 * b];
        let rgb = drawn.iter().flat_map(|pixel| {
            let tinted = tinted(*pixel).map(|value| (value * 255.0).round());
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "display values"
            )]
            tinted.map(|value| value as u8)
        });
        let photograph = Photograph {
            size: [width, height],
            rgb: rgb.collect(),
            mask: Some(vec![255; 128]),
        };
        let image = Image::new(width, height, drawn.clone()).expect("its size");
        let mut pair = Pair::new(&photograph, &image)
            .expect("a pair")
            .expect("a person");
        let before = pair.scores().expect("scores").psnr;
        let mut fit = Fit::default();
        fit.add(&pair);
        let colours = Colours(vec![Matrix3::identity(), fit.solved()]);
        let canvas: Canvas = pair.drawn.clone();
        colours.apply(0, &mut pair);
        assert_eq!(pair.drawn, canvas, "another camera");
        colours.apply(1, &mut pair);
        let after = pair.scores().expect("scores").psnr;
        assert!(before < 32.0 && after > 50.0, "{before} and {after} dB");
        assert_eq!(pair.drawn.pixels[3], [0.0; 3], "black stays");
        assert_eq!(
            Fit::default().solved(),
            Matrix3::identity(),
            "nobody was seen"
        );
    }
}
