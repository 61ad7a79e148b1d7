//! Where a scan is looked at from.

use crate::pinhole::Pinhole;
use glam::DVec3;
use std::f64::consts::TAU;

/// Distance of the eyes from the person's axis, in heights of the person.
const DISTANCE: f64 = 3.2 / 1.75;
/// How far above the middle the eyes are, in their distance.
const RAISED: f64 = 0.08;
/// Share of the picture that the person fills at most.
const FILLED: f64 = 0.85;
/// Width and height of the pictures, pixels.
const SIZE: (u32, u32) = (640, 900);

/// What a ring of views must show: an upright cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Subject {
    /// Its middle, metres.
    pub middle: DVec3,
    /// Its axis, of unit length, upwards.
    pub up: DVec3,
    /// Its height, metres.
    pub height: f64,
    /// Its radius, metres.
    pub radius: f64,
}

impl Subject {
    /// Views from `count` directions evenly around, each turned by so many `turns` (of a whole turn) more than about the axis's own start;
    /// pictures are `share` of 640 x 900 pixels. From a direction along `front` (not along the axis) with 0 turns.
    #[must_use]
    pub fn around(&self, count: u32, front: DVec3, share: f64) -> Vec<Pinhole> {
        let front = front
            .reject_from_normalized(self.up)
            .normalize_or(self.up.any_orthonormal_vector());
        let side = self.up.cross(front);
        let (width, height) = SIZE;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a picture's side"
        )]
        let [width, height] =
            [width, height].map(|side| (f64::from(side) * share).round().max(1.0) as u32);
        let distance = self.height.max(self.radius) * DISTANCE;
        // The nearest point of the cylinder appears largest.
        let nearest = (distance - self.radius).max(0.3 * distance);
        let focal = (FILLED * f64::from(height) * nearest / self.height)
            .min(FILLED * f64::from(width) * nearest / (2.0 * self.radius));
        (0..count)
            .map(|index| {
                let angle = TAU * f64::from(index) / f64::from(count);
                let out = front * angle.cos() + side * angle.sin() + self.up * RAISED;
                let eye = self.middle + out * distance;
                Pinhole::look_at(eye, self.middle, self.up, focal, width, height)
            })
            .collect()
    }
}
