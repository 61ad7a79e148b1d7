//! What leads from one pose to another, to be scaled, kept and added: rotations along the shortest arcs, the rest straight.

use glam::{Quat, Vec3};
use spmm3::{EXPRESSION, JOINTS, Joint, MotionParams};

/// A change of pose, or with "a second" behind every unit a velocity.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Change {
    /// Axis times angle (radians) that each joint turns by, in its parent's frame.
    pub(super) rotations: [Vec3; JOINTS],
    pub(super) expression: [f32; EXPRESSION],
    /// Metres.
    pub(super) root: Vec3,
}

impl Change {
    pub(super) const NONE: Self = Self {
        rotations: [Vec3::ZERO; JOINTS],
        expression: [0.0; EXPRESSION],
        root: Vec3::ZERO,
    };

    pub(super) fn between(from: &MotionParams, to: &MotionParams) -> Self {
        let mut change = Self::NONE;
        for joint in Joint::ALL {
            let turn = to.rotation(joint) * from.rotation(joint).conjugate();
            let shortest = if turn.w < 0.0 { -turn } else { turn };
            change.rotations[joint.index()] = shortest.to_scaled_axis();
        }
        let values = from.expression().iter().zip(to.expression());
        for (value, (from, to)) in change.expression.iter_mut().zip(values) {
            *value = to - from;
        }
        change.root = to.root_translation - from.root_translation;
        change
    }

    /// `share` of this change made to `pose`.
    pub(super) fn applied(&self, pose: &MotionParams, share: f32) -> MotionParams {
        let mut out = pose.clone();
        for joint in Joint::ALL {
            let by = self.rotations[joint.index()] * share;
            if by != Vec3::ZERO {
                let turned = Quat::from_scaled_axis(by) * pose.rotation(joint);
                out.set_rotation(joint, turned.normalize());
            }
        }
        for (value, by) in out.expression_mut().iter_mut().zip(&self.expression) {
            *value += by * share;
        }
        out.root_translation += self.root * share;
        out
    }

    pub(super) fn scaled(&self, by: f32) -> Self {
        Self {
            rotations: self.rotations.map(|v| v * by),
            expression: self.expression.map(|v| v * by),
            root: self.root * by,
        }
    }

    /// The same direction, never further than `limit`, approached smoothly: small changes stay as they are.
    pub(super) fn saturated(&self, limit: &Extent) -> Self {
        let soften = |v: Vec3, limit: f32| {
            let length = v.length();
            if length > 1e-9 {
                v * (limit * (length / limit).tanh() / length)
            } else {
                v
            }
        };
        Self {
            rotations: self.rotations.map(|v| soften(v, limit.radians)),
            expression: self
                .expression
                .map(|v| limit.expression * (v / limit.expression).tanh()),
            root: soften(self.root, limit.metres),
        }
    }

    /// The largest of each kind.
    pub(super) fn extent(&self) -> Extent {
        let largest = |largest: f32, value: f32| largest.max(value.abs());
        Extent {
            radians: self.rotations.iter().map(|v| v.length()).fold(0.0, largest),
            expression: self.expression.iter().copied().fold(0.0, largest),
            metres: self.root.length(),
        }
    }
}

/// How large a change is: the largest angle of a joint, the largest step of an expression coefficient, the root's way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    pub(super) radians: f32,
    pub(super) expression: f32,
    pub(super) metres: f32,
}

impl Extent {
    /// The greatest of the three ratios to `unit`.
    pub(super) fn over(&self, unit: &Self) -> f32 {
        (self.radians / unit.radians)
            .max(self.expression / unit.expression)
            .max(self.metres / unit.metres)
    }
}

/// The pose at `alpha` on the way from one to another: rotations on the shortest arcs, the rest straight.
pub(crate) fn between(from: &MotionParams, to: &MotionParams, alpha: f32) -> MotionParams {
    Change::between(from, to).applied(from, alpha)
}
