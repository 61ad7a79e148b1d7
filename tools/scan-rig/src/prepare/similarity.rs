//! A uniform scale, a turn and a shift.

use crate::scan::Scan;
use glam::{DQuat, DVec3};

/// `to = rotation * (scale * from) + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Lengths in `to` of one unit in `from`; above 0.
    pub scale: f64,
    /// A unit quaternion.
    pub rotation: DQuat,
    /// In units of `to`.
    pub translation: DVec3,
}

impl Similarity {
    /// Nothing moves.
    pub const IDENTITY: Self = Self {
        scale: 1.0,
        rotation: DQuat::IDENTITY,
        translation: DVec3::ZERO,
    };

    /// A point moved.
    #[must_use]
    pub fn point(&self, from: DVec3) -> DVec3 {
        self.rotation * (from * self.scale) + self.translation
    }

    /// First `self`, then `next`.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        Self {
            scale: self.scale * next.scale,
            rotation: (next.rotation * self.rotation).normalize(),
            translation: next.point(self.translation),
        }
    }

    /// Back again.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        let scale = 1.0 / self.scale;
        Self {
            scale,
            rotation,
            translation: rotation * (-self.translation * scale),
        }
    }

    /// A scan moved.
    #[must_use]
    pub fn scan(&self, from: &Scan) -> Scan {
        let mut to = from.clone();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a scan is in single precision"
        )]
        let scale = self.scale as f32;
        to.transform(scale, self.rotation.as_quat(), self.translation.as_vec3());
        to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_after_the_other_is_both_and_the_inverse_goes_back() {
        let first = Similarity {
            scale: 2.0,
            rotation: DQuat::from_rotation_x(0.4),
            translation: DVec3::new(1.0, -2.0, 0.5),
        };
        let second = Similarity {
            scale: 0.3,
            rotation: DQuat::from_rotation_z(-1.1),
            translation: DVec3::new(0.1, 0.2, 0.3),
        };
        let point = DVec3::new(0.3, 0.7, -1.9);
        let both = first.then(&second);
        assert!(
            (both.point(point) - second.point(first.point(point))).length() < 1e-12,
            "both"
        );
        assert!(
            (both.inverse().point(both.point(point)) - point).length() < 1e-12,
            "back"
        );
    }
}
