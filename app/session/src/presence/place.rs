//! A place on the floor of the viewer's room.

use super::standing::Standing;
use glam::{Affine3A, Quat, Vec2, Vec3};
use std::f32::consts::PI;

/// From the viewer to a person they talk to, metres.
pub const DISTANCE: f32 = 1.6;

/// A rigid floor_from_motion that keeps the floor: a turn about y (radians), then a shift along x and z (metres).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    turn: f32,
    shift: Vec2,
}

impl Place {
    /// For who has none yet: before a viewer at the origin.
    pub(super) const UNKNOWN: Self = Self {
        turn: 0.0,
        shift: Vec2::new(0.0, -DISTANCE),
    };

    /// Where `standing` is on `spot` of the floor and faces along `ahead`.
    pub(super) fn on(spot: Vec2, ahead: Vec2, standing: &Standing) -> Self {
        let turn = wrapped(ahead.x.atan2(ahead.y) - standing.heading);
        Self {
            turn,
            shift: spot - turned(standing.spot(), turn),
        }
    }

    /// The spot of the floor that `standing` is on, x and z.
    pub(super) fn spot(&self, standing: &Standing) -> Vec2 {
        turned(standing.spot(), self.turn) + self.shift
    }

    /// With `standing` shifted along the floor, metres, and turned on the spot, radians.
    pub(super) fn moved(&self, standing: &Standing, by: Vec2, turn: f32) -> Self {
        let spot = self.spot(standing) + by;
        let turn = wrapped(self.turn + turn);
        Self {
            turn,
            shift: spot - turned(standing.spot(), turn),
        }
    }

    pub(super) fn floor_from_person(&self) -> Affine3A {
        Affine3A::from_rotation_translation(
            Quat::from_rotation_y(self.turn),
            Vec3::new(self.shift.x, 0.0, self.shift.y),
        )
    }
}

/// A horizontal vector (x, z) turned about y.
pub(super) fn turned(vector: Vec2, radians: f32) -> Vec2 {
    let (sin, cos) = radians.sin_cos();
    Vec2::new(
        cos * vector.x + sin * vector.y,
        cos * vector.y - sin * vector.x,
    )
}

/// The same angle within half a turn to either side.
pub(super) fn wrapped(radians: f32) -> f32 {
    (radians + PI).rem_euclid(2.0 * PI) - PI
}
