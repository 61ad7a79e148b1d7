//! The motion parameters of one frame: all that a sender sends during a call (paper, section IV-C).

use crate::Joint;
use glam::{Quat, Vec3};

/// Number of body pose values: SMPL-X's 25 non-hand joints x 3 (axis-angle, radians).
pub const BODY: usize = 75;
/// Number of expression coefficients: FLAME's first 50.
pub const EXPRESSION: usize = 50;
/// Number of hand pose values: 2 x 15 MANO joints x 3 (axis-angle, radians).
pub const HANDS: usize = 90;
/// Number of motion parameters P = body | expression | hands, in this order.
pub const PARAMS: usize = BODY + EXPRESSION + HANDS;

/// Body joints come first in SMPL-X's order; the hands' follow.
const BODY_JOINTS: usize = BODY / 3;

/// P of the paper (215 numbers) and the root translation that travels beside it.
///
/// Rotations are axis-angle vectors in radians, each relative to the parent joint's frame, in T-pose all zero.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionParams {
    values: [f32; PARAMS],
    /// Translation of the whole person in metres (SMPL-X's `transl`): zero stands the template on its own floor.
    pub root_translation: Vec3,
}

impl Default for MotionParams {
    /// T-pose, neutral face, at the origin.
    fn default() -> Self {
        Self {
            values: [0.0; PARAMS],
            root_translation: Vec3::ZERO,
        }
    }
}

impl MotionParams {
    /// Wraps 215 values in the order body | expression | hands.
    #[must_use]
    pub fn new(values: [f32; PARAMS], root_translation: Vec3) -> Self {
        Self {
            values,
            root_translation,
        }
    }

    /// All 215 values, as the deform graph takes them.
    #[must_use]
    pub fn values(&self) -> &[f32; PARAMS] {
        &self.values
    }

    /// All 215 values, to write.
    pub fn values_mut(&mut self) -> &mut [f32; PARAMS] {
        &mut self.values
    }

    /// The 75 body pose values.
    #[must_use]
    pub fn body(&self) -> &[f32] {
        &self.values[..BODY]
    }

    /// The 50 expression coefficients.
    #[must_use]
    pub fn expression(&self) -> &[f32] {
        &self.values[BODY..BODY + EXPRESSION]
    }

    /// The 50 expression coefficients, to write.
    pub fn expression_mut(&mut self) -> &mut [f32] {
        &mut self.values[BODY..BODY + EXPRESSION]
    }

    /// The 90 hand pose values, left hand first.
    #[must_use]
    pub fn hands(&self) -> &[f32] {
        &self.values[BODY + EXPRESSION..]
    }

    /// Where the three axis-angle values of `joint` begin in [`Self::values`].
    #[must_use]
    pub const fn offset_of(joint: Joint) -> usize {
        let index = joint.index();
        if index < BODY_JOINTS {
            index * 3
        } else {
            EXPRESSION + index * 3
        }
    }

    /// Axis-angle rotation of `joint` relative to its parent, radians.
    #[must_use]
    pub fn axis_angle(&self, joint: Joint) -> Vec3 {
        let at = Self::offset_of(joint);
        Vec3::from_slice(&self.values[at..at + 3])
    }

    /// Sets the axis-angle rotation of `joint` relative to its parent, radians.
    pub fn set_axis_angle(&mut self, joint: Joint, axis_angle: Vec3) {
        let at = Self::offset_of(joint);
        axis_angle.write_to_slice(&mut self.values[at..at + 3]);
    }

    /// Rotation of `joint` relative to its parent.
    #[must_use]
    pub fn rotation(&self, joint: Joint) -> Quat {
        Quat::from_scaled_axis(self.axis_angle(joint))
    }

    /// Sets the rotation of `joint` relative to its parent (stored as the shortest axis-angle vector).
    pub fn set_rotation(&mut self, joint: Joint, rotation: Quat) {
        let shortest = if rotation.w < 0.0 {
            -rotation
        } else {
            rotation
        };
        self.set_axis_angle(joint, shortest.to_scaled_axis());
    }

    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.values.iter().all(|v| v.is_finite()) && self.root_translation.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_tile_body_and_hands_without_touching_the_expression() {
        let mut motion = MotionParams::default();
        for (index, joint) in Joint::ALL.into_iter().enumerate() {
            motion.set_axis_angle(joint, Vec3::splat(index as f32 + 1.0));
        }
        assert!(
            motion.expression().iter().all(|v| *v == 0.0),
            "a joint wrote into the expression"
        );
        assert!(
            motion
                .body()
                .iter()
                .chain(motion.hands())
                .all(|v| *v != 0.0),
            "a pose value belongs to no joint"
        );
        assert_eq!(
            motion.axis_angle(Joint::RightThumb3),
            Vec3::splat(55.0),
            "the last joint is the last of the hands"
        );
    }
}
