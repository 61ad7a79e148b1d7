//! The mesh that carries the Gaussians, in T-pose: from there motions pose it.

use crate::RigError;
use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec3, Vec3A};
use rayon::prelude::*;
use spmm3::{JOINTS, MotionParams, Skeleton, SkinWeights, SkinningTransforms};

/// Rotations and places of the joints in one pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Pose {
    /// World rotations relative to the body model's rest pose.
    pub rotations: [DMat3; JOINTS],
    /// Where the joints are, metres.
    pub joints: [DVec3; JOINTS],
}

/// A mesh in T-pose, soles at y = 0, the pelvis above the origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// Vertices, metres.
    pub vertices: Vec<Vec3>,
    /// The joints there.
    pub skeleton: Skeleton,
}

impl Rest {
    /// Brings vertices from the scan's pose to the T-pose: the inverse of skinning them to the scan's pose.
    ///
    /// # Errors
    /// If a joint is nowhere.
    pub fn new(vertices: &[DVec3], weights: &[SkinWeights], scan: &Pose, tpose: &Pose) -> Result<Self, RigError> {
        let scan_from_rest: [DAffine3; JOINTS] = std::array::from_fn(|joint| {
            let turn = scan.rotations[joint] * tpose.rotations[joint].transpose();
            DAffine3::from_mat3_translation(turn, scan.joints[joint] - turn * tpose.joints[joint])
        });
        let mut at_rest: Vec<DVec3> = vertices
            .par_iter()
            .zip(weights)
            .map(|(vertex, skin)| {
                let mut blended = DAffine3::ZERO;
                for (joint, weight) in skin.joints.iter().zip(skin.weights) {
                    let weight = f64::from(weight);
                    let one = &scan_from_rest[usize::from(*joint).min(JOINTS - 1)];
                    blended.matrix3 += one.matrix3 * weight;
                    blended.translation += one.translation * weight;
                }
                // Joints turned apart by half a turn cancel out: such a vertex follows the first joint alone.
                if !(blended.matrix3.determinant() > 1e-3) {
                    blended = scan_from_rest[usize::from(skin.joints[0]).min(JOINTS - 1)];
                }
                blended.inverse().transform_point3(*vertex)
            })
            .collect();
        let floor = at_rest.iter().fold(f64::INFINITY, |y, v| y.min(v.y));
        let pelvis = tpose.joints[0];
        let shift = DVec3::new(-pelvis.x, -floor, -pelvis.z);
        for vertex in &mut at_rest {
            *vertex += shift;
        }
        Ok(Self {
            vertices: at_rest.into_iter().map(DVec3::as_vec3).collect(),
            skeleton: Skeleton::new(tpose.joints.map(|joint| (joint + shift).as_vec3()))?,
        })
    }

    /// The vertices as a motion poses them, the root's translation left out.
    #[must_use]
    pub fn posed(&self, weights: &[SkinWeights], motion: &MotionParams) -> Vec<Vec3> {
        let mut transforms = SkinningTransforms::default();
        let joints = self.skeleton.pose(motion);
        self.skeleton.skinning(&joints, &mut transforms);
        let posed_from_rest: [Affine3A; JOINTS] =
            spmm3::Joint::ALL.map(|joint| transforms.posed_from_rest(joint));
        self.vertices
            .par_iter()
            .zip(weights)
            .map(|(vertex, skin)| {
                let mut matrix = Mat3A::ZERO;
                let mut translation = Vec3A::ZERO;
                for (joint, weight) in skin.joints.iter().zip(skin.weights) {
                    let one = &posed_from_rest[usize::from(*joint).min(JOINTS - 1)];
                    matrix += one.matrix3 * weight;
                    translation += one.translation * weight;
                }
                (matrix * Vec3A::from(*vertex) + translation).into()
            })
            .collect()
    }
}
