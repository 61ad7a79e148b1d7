//! From what the deform graph gave to a state of Gaussians: on the CPU here, on the device by the renderer.

use crate::error::ReceiverError;
use crate::plan::Plan;
use crate::quality::KEPT_SHARES;
use app_kernels::state::{GaussianState, StateChange};
use app_kernels::{Attributes, PoseInputs, Poser, Skinner};
use npu_runtime::Outputs;
use renderer_splat::posing::{
    BoundMesh, BoundMeshParts, Deformation, DenseParts, DetailLevel, NetworkParts,
};
use spmm3::networks::{Dense, GraphParts};
use spmm3::{Avatar, JOINTS, MotionParams, SkinningTransforms};
use std::ops::Range;

const VERTICES: usize = 0;
const ATTRIBUTES: usize = 1;

/// The kernels that a plan leaves to the CPU.
#[derive(Debug)]
pub(crate) struct Posing {
    graph: GraphParts,
    poser: Poser,
    /// LBS, where the graph leaves it out, and what it gives.
    skin: Option<(Skinner, Vec<f32>)>,
}

impl Posing {
    /// For an avatar whose graph computes what `plan` leaves to it.
    ///
    /// # Errors
    /// If the avatar's networks cannot be read back, or the device does all that the plan divides.
    pub(crate) fn new(avatar: &Avatar, plan: Plan) -> Result<Self, ReceiverError> {
        let graph = plan.graph().ok_or(ReceiverError::NoProvider)?;
        let poser = if graph == GraphParts::Whole {
            Poser::new(avatar)
        } else {
            Poser::with_tail(avatar)?
        };
        let skin = (graph == GraphParts::Networks).then(|| {
            let posed = vec![0.0; 3 * avatar.template.vertices().len()];
            (Skinner::new(&avatar.template), posed)
        });
        Ok(Self { graph, poser, skin })
    }

    /// Number of Gaussians N_g.
    pub(crate) fn gaussians(&self) -> usize {
        self.poser.gaussians()
    }

    /// LBS, if it is left to the CPU: before the first range of a state. Returns whether it was.
    ///
    /// # Errors
    /// If the outputs are not those of the plan's graph.
    pub(crate) fn skin(
        &mut self,
        outputs: &Outputs,
        skinning: &SkinningTransforms,
    ) -> Result<bool, ReceiverError> {
        if let Some((skinner, posed)) = &mut self.skin {
            skinner.skin(outputs.get(VERTICES), skinning, posed)?;
        }
        Ok(self.skin.is_some())
    }

    /// Gaussians `range` of a state; says how far they went since `previous`.
    ///
    /// # Errors
    /// If the outputs are not those of the plan's graph.
    pub(crate) fn pose(
        &self,
        outputs: &Outputs,
        motion: &MotionParams,
        range: Range<usize>,
        previous: Option<&GaussianState>,
        state: &mut GaussianState,
    ) -> Result<StateChange, ReceiverError> {
        let vertices = match &self.skin {
            Some((_, posed)) => posed,
            None => outputs.get(VERTICES),
        };
        let attributes = outputs.get(ATTRIBUTES);
        let inputs = PoseInputs {
            vertices,
            attributes: match self.graph {
                GraphParts::Whole => Attributes::Residuals(attributes),
                GraphParts::Skinned | GraphParts::Networks => Attributes::Potentials(attributes),
            },
            root: motion.root_translation,
        };
        Ok(self.poser.pose(&inputs, range, previous, state)?)
    }
}

/// What a graph of [`GraphParts::Networks`] gave, for a device that poses.
#[must_use]
pub fn computed(outputs: &Outputs) -> Deformation<'_> {
    Deformation::Computed {
        canonical_vertices: outputs.get(VERTICES),
        potentials: outputs.get(ATTRIBUTES),
    }
}

/// The avatar as the renderer takes it to pose it on the device, with the levels of detail that hold the display's rate.
///
/// # Errors
/// If the avatar's networks cannot be read back, or its parts do not fit together.
pub fn bound_mesh(avatar: &Avatar) -> Result<BoundMesh, ReceiverError> {
    let network = avatar.attribute_network()?;
    let (gaussians, controllers) = (&avatar.gaussians, &avatar.controllers);
    let (skin_joints, skin_weights): (Vec<_>, Vec<_>) = (avatar.template.skin().iter())
        .map(|skin| (skin.joints, skin.weights))
        .unzip();
    let mesh = BoundMesh::new(&BoundMeshParts {
        joints: JOINTS,
        skin_joints: &skin_joints,
        skin_weights: &skin_weights,
        corners: gaussians.corners(),
        barycentrics: gaussians.barycentrics(),
        attributes: gaussians.attributes(),
        controllers: controllers.vertices().len(),
        neighbours: controllers.neighbours(),
        masses: controllers.masses(),
        bases: network.bases.bases(),
        units: network.bases.units(),
        scales: network.bases.scales(),
        values: network.bases.values(),
    })?;
    let levels = avatar.kept_levels(&KEPT_SHARES[1..]);
    let levels: Vec<DetailLevel<'_>> = levels
        .iter()
        .map(|level| DetailLevel {
            kept: &level.kept,
            log2_growth: &level.log2_growth,
        })
        .collect();
    Ok(mesh.with_levels(&levels)?)
}

/// The same with the networks, for a device that runs them too.
///
/// # Errors
/// As [`bound_mesh`].
pub fn bound_mesh_with_networks(avatar: &Avatar) -> Result<BoundMesh, ReceiverError> {
    fn dense(layer: &Dense) -> DenseParts<'_> {
        DenseParts {
            weights: layer.weights(),
            bias: layer.bias(),
        }
    }
    let (mesh, attributes) = (avatar.mesh_network()?, avatar.attribute_network()?);
    let rest = mesh.rest_shape(&avatar.template);
    Ok(bound_mesh(avatar)?.with_networks(&NetworkParts {
        first: dense(&mesh.first),
        second: dense(&mesh.second),
        code: dense(&mesh.code),
        fields: mesh.decoder.values(),
        scales: mesh.decoder.scales(),
        unit: mesh.decoder.unit(),
        rest: &rest,
        controllers_first: dense(&attributes.first),
        controllers_second: &attributes.second,
        controllers_bias: &attributes.second_bias,
    })?)
}
