//! A bound on how far a foreground's Gaussians have moved, which decides whether the last sort order can be reused.
//!
//! The writer of the Gaussians states the bound: it has the old and the new values at hand, while memory that is mapped for uploads
//! is slow to read back.

use std::sync::atomic::{AtomicU64, Ordering};

/// How far foreground Gaussians may move, metres, while their order is kept: less than the spacing of a person's.
pub(crate) const KEPT_FOREGROUND_MOVE: f32 = 0.000_25;

/// Octaves by which a foreground Gaussian may grow, a hundredth of its size.
const KEPT_GROWTH: f32 = 0.014_35;

/// By how much an opacity may rise: a Gaussian that was too transparent to be sorted is then at most twice as opaque.
const KEPT_RISE: f32 = shaders_spirv::ALPHA_CUT;

/// The most that any Gaussian of a foreground changed from one writing to the next, each figure a bound. Rotations and
/// colours do not matter to the order.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Change {
    /// The longest way that a Gaussian moved, metres.
    pub metres: f32,
    /// The greatest growth of a standard deviation, octaves (the difference of its logarithms to base 2).
    pub octaves: f32,
    /// The greatest rise of an opacity.
    pub opacity: f32,
}

/// A running sum of the changes of a foreground's Gaussians.
///
/// One bound belongs to one sequence of states of the same Gaussians, however many slots they are written to. The difference of two
/// of its copies bounds the change between the two states. [`Self::new`] starts a sequence that is comparable with no other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionBound {
    /// Unique to a sequence; 0 for no foreground at all.
    epoch: u64,
    /// The sum so far; an order is kept up to 1.
    distance: f64,
}

impl MotionBound {
    /// Of no foreground at all.
    pub(crate) const NONE: Self = Self {
        epoch: 0,
        distance: 0.0,
    };

    /// Starts a sequence: other Gaussians than before, or the same ones after a change of unknown size.
    #[must_use]
    #[expect(
        clippy::new_without_default,
        reason = "no two are equal, as defaults would be"
    )]
    pub fn new() -> Self {
        static EPOCHS: AtomicU64 = AtomicU64::new(1);
        Self {
            epoch: EPOCHS.fetch_add(1, Ordering::Relaxed),
            distance: 0.0,
        }
    }

    /// Adds a change. One that is negative or not finite starts a new sequence.
    pub fn advance(&mut self, change: Change) {
        let parts = [
            change.metres / KEPT_FOREGROUND_MOVE,
            change.octaves / KEPT_GROWTH,
            change.opacity / KEPT_RISE,
        ];
        if parts.iter().all(|part| part.is_finite() && *part >= 0.0) {
            self.distance += f64::from(parts.into_iter().fold(0.0, f32::max));
        } else {
            *self = Self::new();
        }
    }

    /// Whether both are of the same sequence.
    pub(crate) fn is_of(&self, other: &Self) -> bool {
        self.epoch == other.epoch
    }

    /// The bound on the change between two states of a sequence; an order is kept up to 1.
    pub(crate) fn distance_from(&self, then: &Self) -> f64 {
        (self.distance - then.distance).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(start: MotionBound, change: Change) -> MotionBound {
        let mut path = start;
        path.advance(change);
        path
    }

    fn serves(now: &MotionBound, then: &MotionBound) -> bool {
        now.is_of(then) && now.distance_from(then) <= 1.0
    }

    #[test]
    fn an_order_is_kept_for_tiny_motion_growth_or_fading() {
        let start = MotionBound::new();
        let none = Change::default();
        for (change, expected) in [
            (none, true),
            (
                Change {
                    metres: 0.000_24,
                    ..none
                },
                true,
            ),
            (
                Change {
                    metres: 0.000_26,
                    ..none
                },
                false,
            ),
            (
                Change {
                    octaves: 1.009f32.log2(),
                    ..none
                },
                true,
            ),
            (
                Change {
                    octaves: 1.011f32.log2(),
                    ..none
                },
                false,
            ),
            (
                Change {
                    opacity: 0.9 / 255.0,
                    ..none
                },
                true,
            ),
            (
                Change {
                    opacity: 1.1 / 255.0,
                    ..none
                },
                false,
            ),
        ] {
            let there = after(start, change);
            assert_eq!(serves(&there, &start), expected, "{change:?}");
            assert_eq!(serves(&start, &there), expected, "{change:?}, back");
            assert!(there.is_of(&start), "{change:?}: the same Gaussians");
        }
    }

    #[test]
    fn small_steps_add_up_to_a_new_order_even_after_days() {
        let step = Change {
            metres: 0.000_2,
            ..Change::default()
        };
        let mut start = MotionBound::new();
        // Three days of a metre a second.
        for _ in 0..260_000 {
            start.advance(Change {
                metres: 1.0,
                ..step
            });
        }
        let once = after(start, step);
        assert!(serves(&once, &start), "0.2 mm");
        assert!(!serves(&after(once, step), &start), "0.4 mm");
    }

    #[test]
    fn other_gaussians_and_changes_of_unknown_size_are_sorted() {
        let start = MotionBound::new();
        assert!(!MotionBound::new().is_of(&start), "another sequence");
        for metres in [f32::NAN, f32::INFINITY, -1.0] {
            let broken = Change {
                metres,
                ..Change::default()
            };
            assert!(!after(start, broken).is_of(&start), "{metres} m");
        }
    }
}
