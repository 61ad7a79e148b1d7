//! The mesh that carries the Gaussians, in T-pose: from there motions pose it.

use super::Mesh;
use crate::RigError;
use crate::body::posing::{between, chain, t_pose, unskinned};
use crate::body::{BodyModel, Registered, SkinRow};
use glam::{Affine3A, DVec3, Mat3A, Vec3, Vec3A};
use rayon::prelude::*;
use spmm3::{JOINTS, Joint, MotionParams, Skeleton, SkinningTransforms};

/// A mesh in T-pose, soles at y = 0, the pelvis above the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// Vertices, metres.
    pub vertices: Vec<DVec3>,
    /// The joints there.
    pub skeleton: Skeleton,
}

impl Rest {
    /// Brings a mesh from the scan's pose to the T-pose: the inverse of skinning it to the scan's pose.
    ///
    /// # Errors
    /// If a joint is nowhere.
    pub fn new(mesh: &Mesh, model: &BodyModel, registered: &Registered) -> Result<Self, RigError> {
        let (_, joints) = model.shaped(&registered.shape);
        let rotations = t_pose(&joints);
        let at_rest = chain(&rotations, DVec3::ZERO, registered.scale, &joints);
        let scan_from_rest = between(
            (&rotations, &at_rest),
            (&registered.rotations, &registered.joints),
        );
        let mut vertices = unskinned(&mesh.weights, &scan_from_rest, &mesh.vertices);
        let body = vertices.iter().take(model.body_vertices);
        let floor = body.fold(f64::INFINITY, |y, v| y.min(v.y));
        let shift = DVec3::Y * -floor;
        for vertex in &mut vertices {
            *vertex += shift;
        }
        Ok(Self {
            vertices,
            skeleton: Skeleton::new(at_rest.map(|joint| (joint + shift).as_vec3()))?,
        })
    }

    /// The vertices as a motion poses them, metres, the root's translation left out.
    #[must_use]
    pub fn posed(&self, weights: &[SkinRow], motion: &MotionParams) -> Vec<Vec3> {
        let mut transforms = SkinningTransforms::default();
        let joints = self.skeleton.pose(motion);
        self.skeleton.skinning(&joints, &mut transforms);
        let posed_from_rest: [Affine3A; JOINTS] =
            Joint::ALL.map(|joint| transforms.posed_from_rest(joint));
        (self.vertices.par_iter().zip(weights))
            .map(|(vertex, row)| {
                let mut matrix = Mat3A::ZERO;
                let mut translation = Vec3A::ZERO;
                for (weight, map) in row.iter().zip(&posed_from_rest) {
                    if *weight != 0.0 {
                        matrix += map.matrix3 * *weight;
                        translation += map.translation * *weight;
                    }
                }
                (matrix * Vec3A::from(vertex.as_vec3()) + translation).into()
            })
            .collect()
    }
}
