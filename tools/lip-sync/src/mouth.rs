//! A mouth: how much of each shape.

use crate::{CLASSES, SHAPES};

/// How much of each of [`SHAPES`] a mouth has, 0 to 1; at rest all are 0.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mouth {
    /// In the order of [`SHAPES`].
    pub weights: [f32; SHAPES.len()],
}

/// How far each class opens a mouth, for consonants of the tongue a little: the teeth part.
const OTHER_OPENS: f32 = 0.35;

impl Mouth {
    /// The mouth of `probabilities` (of [`CLASSES`]) that is as far open as `loud` (0 to 1) says. Consonants of the tongue have no shape of their own: they
    /// are a little of what lips do at rest while teeth are parted, `e`.
    pub(crate) fn of(probabilities: &[f32; CLASSES.len()], loud: f32) -> Self {
        let [_, a, e, i, o, u, fv, mbp, other] = *probabilities;
        // Lips close for m, b and p however quiet they are; a vowel's opening follows its loudness.
        let opens = |p: f32| p * loud;
        Self {
            weights: [
                opens(a),
                opens(e + OTHER_OPENS * other),
                opens(i),
                opens(o),
                opens(u),
                fv * loud.max(0.5),
                mbp * loud.max(0.5),
            ],
        }
    }

    /// How open it is, 0 to about 1: what the shapes open, the widest being `a`.
    #[must_use]
    pub fn opening(&self) -> f32 {
        let [a, e, i, o, u, fv, _] = self.weights;
        a + 0.6 * e + 0.4 * i + 0.7 * o + 0.4 * u + 0.2 * fv
    }

    /// Moves by the share `towards` (0 to 1) to `other`.
    #[must_use]
    pub fn towards(self, other: &Self, share: f32) -> Self {
        let mut mouth = self;
        for (weight, to) in mouth.weights.iter_mut().zip(other.weights) {
            *weight += share * (to - *weight);
        }
        mouth
    }
}
