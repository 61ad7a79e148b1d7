//! What a solver may be asked to bring together: points, pixels, rotations, directions.

use super::chain::Attachment;
use nalgebra::{Matrix3, UnitQuaternion, Vector2, Vector3};
use spmm3::Joint;

/// Points whose weighted sum a [`Term::Place`] holds.
pub const MAX_POINTS: usize = 4;

/// A camera's pose and lens. Camera axes: x right, y down, z away from the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Rotation from world to camera axes.
    pub camera_from_world: Matrix3<f64>,
    /// The world's origin in camera axes, metres.
    pub translation: Vector3<f64>,
    /// Focal length, pixels.
    pub focal: f64,
    /// Principal point, pixels.
    pub centre: Vector2<f64>,
}

/// Points nearer to the camera than this are projected as if they were here, metres.
pub const NEAREST: f64 = 0.2;

impl View {
    /// Where a point of the world appears, pixels.
    #[must_use]
    pub fn project(&self, point: &Vector3<f64>) -> Vector2<f64> {
        let p = self.camera_from_world * point + self.translation;
        p.xy() * (self.focal / p.z.max(NEAREST)) + self.centre
    }
}

/// One wish with its weight. An information matrix is the inverse of a covariance.
///
/// `robust`: beyond so many standard deviations a residual counts less and less (Cauchy's weight); `None` for never.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Term {
    /// A weighted sum of points is at a place: one point absolutely, or relative to others that have negative weights.
    Place {
        /// The points and their weights; those of weight 0 are left out.
        points: [(Attachment, f64); MAX_POINTS],
        /// Where in the world, metres.
        target: Vector3<f64>,
        /// In the world's axes, 1 / square metres.
        information: Matrix3<f64>,
        /// See above.
        robust: Option<f64>,
    },
    /// A point appears at a pixel.
    Pixel {
        /// The point.
        point: Attachment,
        /// Which of the solver's views.
        view: usize,
        /// Where, pixels.
        target: Vector2<f64>,
        /// 1 / square pixels.
        information: f64,
        /// See above.
        robust: Option<f64>,
    },
    /// A joint has a rotation in the world.
    Orientation {
        /// The joint.
        joint: Joint,
        /// `world_from_joint`.
        target: UnitQuaternion<f64>,
        /// In the world's axes, 1 / square radians.
        information: Matrix3<f64>,
        /// See above.
        robust: Option<f64>,
    },
    /// A joint has a rotation relative to its parent.
    Rotation {
        /// The joint.
        joint: Joint,
        /// `parent_from_joint`.
        target: UnitQuaternion<f64>,
        /// In the parent's axes, 1 / square radians.
        information: Matrix3<f64>,
        /// See above.
        robust: Option<f64>,
    },
    /// An axis of a joint points somewhere.
    Direction {
        /// The joint.
        joint: Joint,
        /// Unit vector in the joint's axes.
        axis: Vector3<f64>,
        /// Unit vector in the world's axes.
        target: Vector3<f64>,
        /// In the world's axes; near the target, 1 / square radians.
        information: Matrix3<f64>,
        /// See above.
        robust: Option<f64>,
    },
}

impl Term {
    /// `point` is at `target`.
    #[must_use]
    pub fn at(point: Attachment, target: Vector3<f64>, information: Matrix3<f64>) -> Self {
        Self::sum(&[(point, 1.0)], target, information)
    }

    /// The weighted sum of up to [`MAX_POINTS`] points is `target`; further points are left out.
    #[must_use]
    pub fn sum(
        points: &[(Attachment, f64)],
        target: Vector3<f64>,
        information: Matrix3<f64>,
    ) -> Self {
        let none = Attachment::centre(Joint::Pelvis);
        let mut all = [(none, 0.0); MAX_POINTS];
        for (slot, point) in all.iter_mut().zip(points) {
            *slot = *point;
        }
        Self::Place {
            points: all,
            target,
            information,
            robust: None,
        }
    }

    /// The same with a robust kernel of width `sigmas`.
    #[must_use]
    pub fn robustly(mut self, sigmas: f64) -> Self {
        match &mut self {
            Self::Place { robust, .. }
            | Self::Pixel { robust, .. }
            | Self::Orientation { robust, .. }
            | Self::Rotation { robust, .. }
            | Self::Direction { robust, .. } => *robust = Some(sigmas),
        }
        self
    }
}
