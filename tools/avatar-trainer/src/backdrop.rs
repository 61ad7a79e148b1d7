//! A colour behind the person, another one in every fourth step, and black in the others.
//!
//! Before black alone, black Gaussians around the person are as good as none, and stay there: a fringe that shows wherever the avatar stands before anything
//! else, goes with the limb it is bound to, and grows to spikes in poses unlike the capture's. Before another colour in every step they go as well, but 200
//! Gaussians that learn four pictures by heart come 3 dB less near to them.

use crate::random::mixed;
use splat_gradient::Picture;
use splat_gradient::error::GradientError;
use splat_gradient::loss::Target;

/// The part of what a seed decides that backdrops are.
const BACKDROP: u64 = u64::MAX - 3;

/// It is black but for one step of so many.
const EVERY: u64 = 4;
/// Which of them: one in which neither L_scale nor L_guide is taken.
const TURN: u64 = 1;

/// Red, green and blue as display values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Backdrop([f32; 3]);

impl Backdrop {
    /// The one of a step.
    pub(crate) fn of_step(seed: u64, step: u64) -> Self {
        if step % EVERY != TURN {
            return Self([0.0; 3]);
        }
        let mut rng = fastrand::Rng::with_seed(mixed(mixed(seed, BACKDROP), step));
        Self([(); 3].map(|()| rng.f32()))
    }

    /// Its red, green and blue.
    pub(crate) fn colour(&self) -> [f32; 3] {
        self.0
    }

    /// The picture before it; its alpha stays.
    ///
    /// # Errors
    /// None but those of a picture's size, which is kept.
    pub(crate) fn behind(&self, picture: &Picture) -> Result<Picture, GradientError> {
        let alpha = picture.plane(3);
        let mut numbers = Vec::with_capacity(picture.numbers().len());
        for (channel, colour) in self.0.iter().enumerate() {
            let pixels = picture.plane(channel).iter().zip(alpha);
            numbers.extend(pixels.map(|(front, alpha)| front + (1.0 - alpha) * colour));
        }
        numbers.extend_from_slice(alpha);
        Picture::new(picture.width(), picture.height(), numbers)
    }

    /// The photograph's person before it.
    ///
    /// # Errors
    /// None but those of a picture's size, which is kept.
    pub(crate) fn behind_target(&self, target: &Target) -> Result<Target, GradientError> {
        Target::weighted(self.behind(target.picture())?, target.weights().to_vec())
    }

    /// Turns derivatives by the picture before it into those by the picture alone, in place.
    pub(crate) fn pull_back(&self, by_pixel: &mut Picture) {
        let pixels = by_pixel.width() * by_pixel.height();
        let (colours, by_alpha) = by_pixel.numbers_mut().split_at_mut(3 * pixels);
        for (plane, colour) in colours.chunks_exact(pixels.max(1)).zip(self.0) {
            for (by_alpha, by) in by_alpha.iter_mut().zip(plane) {
                *by_alpha -= colour * by;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use splat_gradient::loss::colour_l1;

    #[test]
    fn every_fourth_step_has_its_own_and_a_seed_decides_them() {
        let of = Backdrop::of_step;
        assert_eq!(of(1, 9), of(1, 9), "the same step");
        assert_ne!(of(1, 9), of(1, 13), "another one");
        assert_ne!(of(1, 9), of(2, 9), "another seed");
        assert_eq!(of(1, 8), Backdrop([0.0; 3]), "black between them");
    }

    #[test]
    fn black_where_nobody_is_costs_something_and_its_derivatives_are_those_of_the_sum() {
        let backdrop = Backdrop([0.5, 0.25, 1.0]);
        // Two pixels: nobody, and a grey person. Drawn: half a black veil before both.
        let wanted = Picture::new(2, 1, vec![0.0, 0.4, 0.0, 0.4, 0.0, 0.4, 0.0, 1.0]);
        let mut drawn =
            Picture::new(2, 1, vec![0.0, 0.3, 0.0, 0.3, 0.0, 0.3, 0.5, 0.7]).expect("two");
        let target = backdrop
            .behind_target(&Target::new(wanted.expect("two")))
            .expect("as large");
        let loss = |drawn: &Picture, by: &mut Picture| {
            let shown = backdrop.behind(drawn).expect("as large");
            colour_l1(&shown, &target, 1.0, by).expect("as large")
        };
        let mut by = Picture::transparent(2, 1);
        let before = loss(&drawn, &mut by);
        assert!(before > 0.1, "the veil is seen: {before}");
        backdrop.pull_back(&mut by);
        for at in 0..8 {
            let kept = drawn.numbers()[at];
            let mut at_side = |aside: f32| {
                drawn.numbers_mut()[at] = kept + aside;
                loss(&drawn, &mut Picture::transparent(2, 1))
            };
            let slope = (at_side(1e-3) - at_side(-1e-3)) / 2e-3;
            drawn.numbers_mut()[at] = kept;
            let found = f64::from(by.numbers()[at]);
            assert!((slope - found).abs() < 1e-3, "{at}: {slope}, not {found}");
        }
    }
}
