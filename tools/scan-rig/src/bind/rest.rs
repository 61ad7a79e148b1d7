//! The mesh that carries the Gaussians, in T-pose: from there motions pose it.

use super::Mesh;
use crate::RigError;
use crate::body::posing::{JointPose, brought_to_t_pose, posed_by_motion, skinned};
use crate::body::{BodyModel, Registered, SkinRow};
use glam::{DVec3, Vec3};
use spmm3::{MotionParams, Skeleton};

/// A mesh in T-pose, soles at y = 0, the hips above the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// Vertices, metres.
    pub vertices: Vec<DVec3>,
    /// The joints there.
    pub skeleton: Skeleton,
}

impl Rest {
    /// Brings a mesh from the scan's pose to the T-pose.
    pub(super) fn new(
        mesh: &Mesh,
        model: &BodyModel,
        registered: &Registered,
    ) -> Result<Self, RigError> {
        let (vertices, pose) = brought_to_t_pose(
            &mesh.vertices,
            &mesh.weights,
            model.body_vertices,
            &JointPose::of_scan(registered),
            &JointPose::t_pose(model, registered),
        );
        Ok(Self {
            vertices,
            skeleton: Skeleton::new(pose.joints.map(|joint| joint.as_vec3()))?,
        })
    }

    /// The vertices as a motion poses them, metres, the root's translation left out.
    #[must_use]
    pub fn posed(&self, weights: &[SkinRow], motion: &MotionParams) -> Vec<Vec3> {
        let maps = posed_by_motion(&self.skeleton, motion);
        super::single(&skinned(weights, &maps, &self.vertices))
    }
}
