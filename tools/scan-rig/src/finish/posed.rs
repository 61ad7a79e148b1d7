//! An avatar posed on the CPU, without a runtime: for measuring it.

use crate::RigError;
use crate::body::SkinRow;
use crate::body::posing::{posed_by_motion, skinned};
use crate::scan::Scan;
use glam::{DVec3, Vec3};
use reconstruct::fit::{MeshRunner, residuals};
use spmm3::networks::{AttributeNetwork, MeshNetwork};
use spmm3::{Avatar, GaussianSet, MotionParams, PersonError, PlanarVertices, SH_C0, SkinWeights};

/// An avatar's networks, read back from its deform graph.
#[derive(Debug)]
pub struct Poser<'a> {
    avatar: &'a Avatar,
    mesh: MeshNetwork,
    attributes: AttributeNetwork,
    bases: Vec<f32>,
    weights: Vec<SkinRow>,
}

impl<'a> Poser<'a> {
    /// Reads the networks.
    ///
    /// # Errors
    /// If the avatar's graph holds others than this project writes.
    pub fn new(avatar: &'a Avatar) -> Result<Self, RigError> {
        let unknown = |e: spmm3::networks::GraphRefused| RigError::unsuited(e.to_string());
        let graph = &avatar.deform_graph;
        let mesh = MeshNetwork::read(graph, &avatar.template).map_err(unknown)?;
        let attributes = AttributeNetwork::read(graph, &avatar.controllers).map_err(unknown)?;
        let bases = attributes.bases.dequantise();
        Ok(Self {
            avatar,
            mesh,
            attributes,
            bases,
            weights: (avatar.template.skin().iter())
                .map(SkinWeights::dense)
                .collect(),
        })
    }

    /// The mesh of a motion, metres, the root's translation included, `[N_v]`.
    #[must_use]
    pub fn vertices(&self, motion: &MotionParams) -> Vec<Vec3> {
        let offsets = MeshRunner::new(&self.mesh).offsets(motion);
        let expressed: Vec<DVec3> = (self.avatar.template.vertices().iter().zip(offsets))
            .map(|(rest, offset)| (*rest + offset).as_dvec3())
            .collect();
        let maps = posed_by_motion(&self.avatar.skeleton, motion);
        (skinned(&self.weights, &maps, &expressed).iter())
            .map(|vertex| vertex.as_vec3() + motion.root_translation)
            .collect()
    }

    /// The Gaussians of a motion, as the deform graph and F_m2g give them.
    ///
    /// # Errors
    /// None that a checked avatar could cause.
    pub fn gaussians(&self, motion: &MotionParams) -> Result<GaussianSet, PersonError> {
        let vertices = self.vertices(motion);
        let planes: Vec<f32> = (0..3)
            .flat_map(|axis| vertices.iter().map(move |v| v[axis]))
            .collect();
        let avatar = self.avatar;
        let mut upright = motion.clone();
        upright.root_translation = Vec3::ZERO;
        let residuals = residuals(&self.attributes, &self.bases, &avatar.controllers, &upright);
        let mut set = GaussianSet::zeroed(avatar.gaussians.len());
        let posed = PlanarVertices::new(&planes, vertices.len())?;
        avatar
            .gaussians
            .pose(posed, Some(&residuals), Vec3::ZERO, &mut set)?;
        Ok(set)
    }

    /// The same as a scan.
    ///
    /// # Errors
    /// As [`Self::gaussians`].
    pub fn scan(&self, motion: &MotionParams) -> Result<Scan, PersonError> {
        let set = self.gaussians(motion)?;
        Ok(Scan {
            positions: set.positions,
            rotations: set.rotations,
            scales: set.log_scales.iter().map(|s| s.map(f32::exp)).collect(),
            opacities: (set.opacity_logits.iter())
                .map(|logit| 1.0 / (1.0 + (-logit).exp()))
                .collect(),
            colours: set.colours.iter().map(|c| *c * SH_C0 + 0.5).collect(),
        })
    }
}
