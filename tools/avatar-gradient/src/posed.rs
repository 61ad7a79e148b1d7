//! One pose of an avatar, with everything that its derivatives need again.

use crate::attributes::ControllerPass;
use crate::kinematics::JointPass;
use crate::mesh::MeshPass;
use crate::skinning::ByJoints;
use glam::Vec3;
use splat_gradient::Attributes;
use spmm3::MotionParams;

/// What [`crate::Model::pose`] computed. Keeps its memory from one pose to the next: about 40 numbers a Gaussian beside the forces.
#[derive(Debug, Clone, Default)]
pub struct Posed {
    /// The corrected motion.
    pub(crate) motion: MotionParams,
    /// What the networks see of it, `[215]`.
    pub(crate) inputs: Vec<f32>,
    pub(crate) joints: JointPass,
    pub(crate) mesh: MeshPass,
    pub(crate) controllers: ControllerPass,
    /// [3, N_v], metres: in T-pose, and in the world.
    pub(crate) canonical: Vec<f32>,
    pub(crate) vertices: Vec<f32>,
    /// [B, N_g]; empty without F_attr.
    pub(crate) forces: Vec<f32>,
    /// Template attributes plus residuals, [14, N_g].
    pub(crate) local: Vec<f32>,
    pub(crate) world: Attributes,
    /// Offset that each controller causes, row-major [C, 3], and the mean position bases [B, C, 3], where they were asked for.
    pub(crate) offsets: Vec<f32>,
    pub(crate) mean_bases: Vec<f32>,
    pub(crate) back: Back,
}

/// Memory of the backward pass.
#[derive(Debug, Clone, Default)]
pub(crate) struct Back {
    /// Derivatives by `local`, [14, N_g].
    pub(crate) by_local: Vec<f32>,
    /// What L_guide pulls at position bases; empty where it was left out.
    pub(crate) pulls: Vec<f32>,
    pub(crate) by_corners: Vec<f32>,
    pub(crate) by_forces: Vec<f32>,
    pub(crate) by_basis: Vec<f32>,
    pub(crate) by_potentials: Vec<f32>,
    pub(crate) by_vertices: Vec<f32>,
    pub(crate) by_canonical: Vec<f32>,
    pub(crate) by_joints: Vec<ByJoints>,
}

impl Posed {
    /// Before the first pose.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The Gaussians in the world, as `splat-gradient` draws them: metres, unit quaternions, ln metres, logits, display values.
    #[must_use]
    pub fn gaussians(&self) -> &Attributes {
        &self.world
    }

    /// Posed vertices in the world, row-major [3, N_v], metres. Unlike the deform graph's, with the root translation.
    #[must_use]
    pub fn vertices(&self) -> &[f32] {
        &self.vertices
    }

    /// Canonical vertices, template plus F_mesh, row-major [3, N_v], metres.
    #[must_use]
    pub fn canonical(&self) -> &[f32] {
        &self.canonical
    }

    /// Template attributes plus residuals in the triangles' frames, row-major [14, N_g].
    #[must_use]
    pub fn local(&self) -> &[f32] {
        &self.local
    }

    /// Displacement potentials u_j, row-major [C, B]; empty where F_attr is switched off.
    #[must_use]
    pub fn potentials(&self) -> &[f32] {
        &self.controllers.potentials
    }

    /// Dragging forces F_i, row-major [B, N_g]; empty where F_attr is switched off.
    #[must_use]
    pub fn forces(&self) -> &[f32] {
        &self.forces
    }

    /// The motion that was posed, its correction applied.
    #[must_use]
    pub fn motion(&self) -> &MotionParams {
        &self.motion
    }

    /// Root translation, metres.
    #[must_use]
    pub fn root(&self) -> Vec3 {
        self.motion.root_translation
    }
}
