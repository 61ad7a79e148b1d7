//! A person's parts in the renderer's form for posing on the device, and the networks that drive them.

use npu_runtime::{Outputs, Provider, Runtime, Session, TensorSpec};
use renderer_splat::posing::{BoundMesh, BoundMeshParts, Deformation, PosedInput};
use spmm3::networks::{Dialect, GraphParts, Port, QuantisedBases};
use spmm3::{
    Avatar, BoundGaussians, Controllers, JOINTS, MotionParams, SkinningTransforms, Template,
};

/// The person as a mesh with Gaussians on it.
///
/// # Panics
/// If the parts are not one person's.
#[must_use]
pub fn bound_mesh(
    template: &Template,
    gaussians: &BoundGaussians,
    controllers: &Controllers,
    bases: &QuantisedBases,
) -> BoundMesh {
    let (skin_joints, skin_weights): (Vec<_>, Vec<_>) = template
        .skin()
        .iter()
        .map(|skin| (skin.joints, skin.weights))
        .unzip();
    BoundMesh::new(&BoundMeshParts {
        joints: JOINTS,
        skin_joints: &skin_joints,
        skin_weights: &skin_weights,
        corners: gaussians.corners(),
        barycentrics: gaussians.barycentrics(),
        attributes: gaussians.attributes(),
        controllers: controllers.vertices().len(),
        neighbours: controllers.neighbours(),
        masses: controllers.masses(),
        bases: bases.bases(),
        units: bases.units(),
        scales: bases.scales(),
        values: bases.values(),
    })
    .expect("one person's parts fit together")
}

/// [`bound_mesh`] of an avatar.
///
/// # Panics
/// If its graph is not ours, which reading a package makes sure of.
#[must_use]
pub fn avatar_mesh(avatar: &Avatar) -> BoundMesh {
    let network = avatar.attribute_network().expect("our graph");
    bound_mesh(
        &avatar.template,
        &avatar.gaussians,
        &avatar.controllers,
        &network.bases,
    )
}

/// A session of some parts of an avatar's graph.
///
/// # Panics
/// If ONNX Runtime does not take them.
#[must_use]
pub fn session(runtime: &Runtime, avatar: &Avatar, parts: GraphParts) -> Session {
    session_in(runtime, avatar, parts, Dialect::Package)
}

/// The same in a dialect.
///
/// # Panics
/// As [`session`].
#[must_use]
pub fn session_in(
    runtime: &Runtime,
    avatar: &Avatar,
    parts: GraphParts,
    dialect: Dialect,
) -> Session {
    let ports = parts.ports(&avatar.graph_sizes().expect("our graph"));
    let specs = |ports: &[Port]| -> Vec<TensorSpec> {
        let spec = |(name, shape): &Port| TensorSpec::new(name, shape);
        ports.iter().map(spec).collect()
    };
    Session::new(
        runtime,
        &*avatar
            .graph(parts, dialect)
            .expect("the networks come back"),
        Provider::Cpu { threads: 2 },
        &specs(&ports.inputs),
        &specs(&ports.outputs),
    )
    .expect("ONNX Runtime takes the parts")
}

/// An avatar's networks alone, as the GPU placement runs them.
#[derive(Debug)]
pub struct Networks {
    session: Session,
    outputs: Outputs,
    skinning: SkinningTransforms,
}

impl Networks {
    /// Loads them.
    ///
    /// # Panics
    /// If ONNX Runtime does not take them.
    #[must_use]
    pub fn new(runtime: &Runtime, avatar: &Avatar) -> Self {
        let session = session(runtime, avatar, GraphParts::Networks);
        Self {
            outputs: session.outputs().expect("memory for them"),
            session,
            skinning: SkinningTransforms::default(),
        }
    }

    /// The results of networks and skeleton for a motion.
    ///
    /// # Panics
    /// If the graph does not run.
    pub fn pose(&mut self, avatar: &Avatar, motion: &MotionParams) -> PosedInput<'_> {
        let joints = avatar.skeleton.pose(motion);
        avatar.skeleton.skinning(&joints, &mut self.skinning);
        self.session.input_mut(0).copy_from_slice(motion.values());
        self.session.run(&mut self.outputs).expect("the graph runs");
        PosedInput {
            deformation: Deformation::Computed {
                canonical_vertices: self.outputs.get(0),
                potentials: self.outputs.get(1),
            },
            skinning: &self.skinning.0,
            root: motion.root_translation.to_array(),
        }
    }
}
