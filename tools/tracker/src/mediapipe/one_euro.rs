//! The One-Euro filter (Casiez, Roussel and Vogel, "1 € Filter", CHI 2012) with velocities relative to an object's size.
//!
//! It is a part of MediaPipe's graph: landmarks in pixels, with MediaPipe's own form of the low pass, so that regions are where MediaPipe
//! has them. `motion_fit::smoother` has the filter for a motion's rotations, with exact low passes and the fit's confidence; neither could
//! stand in for the other without changing what it is compared with.

use std::f64::consts::TAU;

/// Filters one coordinate.
#[derive(Debug, Clone)]
pub(super) struct OneEuro {
    /// Below this the filter smooths at rest, Hz.
    min_cutoff: f64,
    /// How much speed raises the cut-off.
    beta: f64,
    last: Option<Last>,
}

#[derive(Debug, Clone, Copy)]
struct Last {
    seconds: f64,
    raw: f64,
    filtered: f64,
    /// Object's sizes a second.
    speed: f64,
}

/// The cut-off of the speed's own filter, Hz.
const SPEED_CUTOFF: f64 = 1.0;

impl OneEuro {
    pub(super) fn new(min_cutoff: f64, beta: f64) -> Self {
        Self {
            min_cutoff,
            beta,
            last: None,
        }
    }

    /// Forgets the past.
    pub(super) fn reset(&mut self) {
        self.last = None;
    }

    /// `value` at `seconds`, filtered, of an object of `size` in the value's unit. A value that does not come later than the last
    /// one, or that is not finite, is returned as it is.
    pub(super) fn apply(&mut self, seconds: f64, value: f64, size: f64) -> f64 {
        if !(value.is_finite() && seconds.is_finite() && size > 1e-6) {
            return value;
        }
        let Some(last) = self.last else {
            self.last = Some(Last {
                seconds,
                raw: value,
                filtered: value,
                speed: 0.0,
            });
            return value;
        };
        let passed = seconds - last.seconds;
        if passed <= 0.0 {
            return value;
        }
        let weight = |cutoff: f64| 1.0 / (1.0 + 1.0 / (TAU * cutoff * passed));
        let mix = |old: f64, new: f64, weight: f64| old + (new - old) * weight;
        let speed = (value - last.raw) / size / passed;
        let speed = mix(last.speed, speed, weight(SPEED_CUTOFF));
        let cutoff = self.min_cutoff + self.beta * speed.abs();
        let filtered = mix(last.filtered, value, weight(cutoff));
        self.last = Some(Last {
            seconds,
            raw: value,
            filtered,
            speed,
        });
        filtered
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_at_rest_comes_through_and_a_jump_is_slowed() {
        let mut filter = OneEuro::new(0.01, 0.0);
        for i in 0..10 {
            let got = filter.apply(f64::from(i) / 30.0, 5.0, 100.0);
            assert!((got - 5.0).abs() < 1e-12, "{got}");
        }
        let got = filter.apply(11.0 / 30.0, 15.0, 100.0);
        // RC filter: tau = 1 / (2 pi 0.01 Hz) = 15.9 s, after 2/30 s.
        let expected = 5.0 + 10.0 * (2.0 / 30.0) / (2.0 / 30.0 + 15.915_494);
        assert!((got - expected).abs() < 1e-6, "{got} against {expected}");
    }

    #[test]
    fn numbers_that_are_none_and_times_that_stand_still_change_nothing() {
        let mut filter = OneEuro::new(0.01, 10.0);
        assert!(filter.apply(0.0, f64::NAN, 1.0).is_nan(), "as it came");
        assert!((filter.apply(0.0, 1.0, 1.0) - 1.0).abs() < 1e-12, "first");
        assert!(
            (filter.apply(0.0, 2.0, 1.0) - 2.0).abs() < 1e-12,
            "same time"
        );
        assert!(filter.apply(1.0, 1.0, 1.0).is_finite(), "later");
    }
}
