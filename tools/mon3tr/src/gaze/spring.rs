//! A critically damped spring: a value that follows another one smoothly and never overshoots.

use std::ops::{Add, Mul, Sub};
use std::time::Duration;

/// A value on a spring.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Spring<T> {
    pub(super) at: T,
    /// How fast it changes, 1/s.
    speed: T,
}

impl<T: Copy + Default + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>> Spring<T> {
    /// At rest there.
    pub(super) fn resting(at: T) -> Self {
        Self {
            at,
            speed: T::default(),
        }
    }

    /// After `elapsed` of being pulled to `wanted`: half of the way after 1.7 / `stiffness` seconds. Exact for any step, so that a slow display does not
    /// shake it.
    pub(super) fn pull(&mut self, wanted: T, stiffness: f32, elapsed: Duration) {
        let t = elapsed.as_secs_f32();
        let decay = (-stiffness * t).exp();
        let off = self.at - wanted;
        let pull = self.speed + off * stiffness;
        self.at = wanted + (off + pull * t) * decay;
        self.speed = (self.speed - pull * (stiffness * t)) * decay;
    }
}
