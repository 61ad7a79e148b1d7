//! An affine correction of each camera's colours: cameras differ in white balance and exposure, the person does not.
//!
//! What the avatar shows in a camera is c' = M c + alpha b, with c premultiplied: the correction of a colour behind any alpha. It belongs
//! to the capture and is not part of the avatar.

use splat_gradient::Picture;
use splat_gradient::adam::{Adam, Group};
use splat_gradient::error::GradientError;

/// Numbers of a correction: rows of M, each followed by its number of b.
pub const NUMBERS: usize = 12;

/// How far a number moves in a step, before it decays with the training's other rates.
const RATE: f32 = 1e-3;
/// Pull towards the identity: without it, avatar and corrections could drift together.
const PULL: f32 = 1e-2;

/// One camera's correction, and what Adam remembers of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// Three rows of [M | b].
    pub numbers: [f32; NUMBERS],
    /// Adam's memory.
    pub adam: Adam,
}

impl Default for Correction {
    /// Colours as they are.
    fn default() -> Self {
        let mut numbers = [0.0; NUMBERS];
        for channel in 0..3 {
            numbers[channel * 4 + channel] = 1.0;
        }
        Self {
            numbers,
            adam: Adam::new(NUMBERS),
        }
    }
}

impl Correction {
    /// The drawn picture as the camera would have shown it.
    ///
    /// # Errors
    /// None but those of a picture's size, which is kept.
    pub fn apply(&self, drawn: &Picture) -> Result<Picture, GradientError> {
        let pixels = drawn.width() * drawn.height();
        let mut numbers = Vec::with_capacity(4 * pixels);
        let [red, green, blue, alpha] = [0, 1, 2, 3].map(|channel| drawn.plane(channel));
        for row in self.numbers.chunks_exact(4) {
            let pixels = red.iter().zip(green).zip(blue).zip(alpha);
            numbers.extend(
                pixels.map(|(((r, g), b), a)| row[0] * r + row[1] * g + row[2] * b + row[3] * a),
            );
        }
        numbers.extend_from_slice(alpha);
        Picture::new(drawn.width(), drawn.height(), numbers)
    }

    /// Turns derivatives by the corrected picture into those by the drawn one, in place, and returns those by the correction's numbers.
    #[must_use]
    pub fn pull_back(&self, drawn: &Picture, by_pixel: &mut Picture) -> [f32; NUMBERS] {
        let pixels = drawn.width() * drawn.height();
        let mut by_numbers = [0.0f64; NUMBERS];
        let shown = drawn.numbers();
        let by = by_pixel.numbers_mut();
        for pixel in 0..pixels {
            let at = [0, 1, 2, 3].map(|channel| shown[channel * pixels + pixel]);
            let corrected = [0, 1, 2].map(|channel| by[channel * pixels + pixel]);
            if corrected == [0.0; 3] {
                continue;
            }
            let mut back = [0.0f32; 4];
            for (channel, derivative) in corrected.into_iter().enumerate() {
                let row = &self.numbers[channel * 4..channel * 4 + 4];
                for k in 0..4 {
                    back[k] += row[k] * derivative;
                    by_numbers[channel * 4 + k] += f64::from(derivative * at[k]);
                }
            }
            for (channel, derivative) in back.into_iter().enumerate().take(3) {
                by[channel * pixels + pixel] = derivative;
            }
            by[3 * pixels + pixel] += back[3];
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "derivatives are single precision"
        )]
        by_numbers.map(|number| number as f32)
    }

    /// Makes a step, `slower` (0..=1) than at the training's start.
    ///
    /// # Errors
    /// An Adam of another number of numbers.
    pub fn step(&mut self, by_numbers: &[f32; NUMBERS], slower: f32) -> Result<(), GradientError> {
        let identity = Self::default().numbers;
        let mut gradient = *by_numbers;
        for ((gradient, number), rest) in gradient.iter_mut().zip(&self.numbers).zip(identity) {
            *gradient += PULL * (number - rest);
        }
        let group = Group {
            count: NUMBERS,
            rate: RATE * slower,
        };
        self.adam.step(&mut self.numbers, &gradient, &[group])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use synthetic_person::Random;

    const SIDE: usize = 5;

    fn random_picture(random: &mut Random) -> Picture {
        let numbers = (0..4 * SIDE * SIDE).map(|_| random.unit()).collect();
        Picture::new(SIDE, SIDE, numbers).expect("as many")
    }

    /// A loss that is linear in the corrected picture, in f64 and written out.
    fn loss(numbers: &[f64], drawn: &[f64], slopes: &[f32]) -> f64 {
        let pixels = SIDE * SIDE;
        let mut sum = 0.0;
        for pixel in 0..pixels {
            for channel in 0..3 {
                let mut corrected = 0.0;
                for k in 0..4 {
                    corrected += numbers[channel * 4 + k] * drawn[k * pixels + pixel];
                }
                sum += corrected * f64::from(slopes[channel * pixels + pixel]);
            }
            sum += drawn[3 * pixels + pixel] * f64::from(slopes[3 * pixels + pixel]);
        }
        sum
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        let mut random = Random::new(3);
        let mut correction = Correction::default();
        for number in &mut correction.numbers {
            *number += 0.3 * random.signed();
        }
        let drawn = random_picture(&mut random);
        let slopes = random_picture(&mut random);
        let mut by_pixel = slopes.clone();
        let by_numbers = correction.pull_back(&drawn, &mut by_pixel);
        let wide = |numbers: &[f32]| numbers.iter().map(|n| f64::from(*n)).collect::<Vec<_>>();
        let (numbers, pixels) = (wide(&correction.numbers), wide(drawn.numbers()));
        let step = 1e-4;
        for k in 0..NUMBERS {
            let at = |sign: f64| {
                let mut moved = numbers.clone();
                moved[k] += sign * step;
                loss(&moved, &pixels, slopes.numbers())
            };
            let expected = (at(1.0) - at(-1.0)) / (2.0 * step);
            let got = f64::from(by_numbers[k]);
            assert!((got - expected).abs() < 1e-4, "{k}: {got}, {expected}");
        }
        for k in 0..4 * SIDE * SIDE {
            let at = |sign: f64| {
                let mut moved = pixels.clone();
                moved[k] += sign * step;
                loss(&numbers, &moved, slopes.numbers())
            };
            let expected = (at(1.0) - at(-1.0)) / (2.0 * step);
            let got = f64::from(by_pixel.numbers()[k]);
            assert!(
                (got - expected).abs() < 1e-4,
                "pixel {k}: {got}, {expected}"
            );
        }
    }

    #[test]
    fn the_pull_towards_the_identity_is_that_of_finite_differences() {
        let mut random = Random::new(8);
        let mut correction = Correction::default();
        for number in &mut correction.numbers {
            *number += 0.3 * random.signed();
        }
        let before = correction.numbers.map(f64::from);
        let pull = |numbers: &[f64; NUMBERS]| -> f64 {
            let identity = Correction::default().numbers.map(f64::from);
            let squares = numbers
                .iter()
                .zip(identity)
                .map(|(x, rest)| (x - rest).powi(2));
            0.5 * f64::from(PULL) * squares.sum::<f64>()
        };
        correction.step(&[0.0; NUMBERS], 1.0).expect("as many");
        for k in 0..NUMBERS {
            let at = |sign: f64| {
                let mut moved = before;
                moved[k] += sign * 1e-4;
                pull(&moved)
            };
            let expected = (at(1.0) - at(-1.0)) / 2e-4;
            // Adam's first mean after one step: a tenth of the derivative.
            let got = 10.0 * f64::from(correction.adam.first[k]);
            assert!((got - expected).abs() < 1e-7, "{k}: {got}, {expected}");
        }
    }

    #[test]
    fn a_fresh_correction_changes_nothing() {
        let drawn = random_picture(&mut Random::new(5));
        let same = Correction::default().apply(&drawn).expect("one size");
        assert_eq!(same, drawn, "the same");
    }
}
