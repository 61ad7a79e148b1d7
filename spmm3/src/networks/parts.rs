//! Which parts of the deform graph one ONNX model computes: the rest is for kernels of our own, on another unit.

use super::{AttributeNetwork, DeformGraph, MeshNetwork, input, output};
use crate::package::{Avatar, PackageError};
use crate::{ATTRIBUTES, JOINTS, PARAMS};
use std::borrow::Cow;

/// What a deform graph computes of F_mesh -> LBS and F_attr's controllers -> F_attr's tail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum GraphParts {
    /// Everything: `posed_vertices` [3, N_v] and `residuals` [14, N_g]. What a package holds.
    Whole,
    /// All but F_attr's tail: `posed_vertices` [3, N_v] and `potentials` [C, B].
    Skinned,
    /// The networks alone, from `motion` only: `canonical_vertices` [3, N_v] and `potentials` [C, B].
    Networks,
}

/// An input or output: its name and its static shape, float.
pub type Port = (&'static str, [usize; 2]);

/// How many of everything there are in a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GraphSizes {
    /// Template vertices N_v.
    pub vertices: usize,
    /// Gaussians N_g.
    pub gaussians: usize,
    /// Controllers C.
    pub controllers: usize,
    /// Deformation bases B.
    pub bases: usize,
}

/// A graph's inputs and outputs, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GraphPorts {
    /// `motion`, and `skinning` unless the graph leaves LBS out.
    pub inputs: Vec<Port>,
    /// The vertices, then residuals or potentials.
    pub outputs: Vec<Port>,
}

impl GraphParts {
    /// The inputs and outputs of a graph of these parts.
    #[must_use]
    pub fn ports(self, sizes: &GraphSizes) -> GraphPorts {
        let mut inputs = vec![(input::MOTION, [1, PARAMS])];
        if self != Self::Networks {
            inputs.push((input::SKINNING, [12, JOINTS]));
        }
        let vertices = match self {
            Self::Whole | Self::Skinned => output::VERTICES,
            Self::Networks => output::CANONICAL_VERTICES,
        };
        let attributes = match self {
            Self::Whole => (output::RESIDUALS, [ATTRIBUTES, sizes.gaussians]),
            Self::Skinned | Self::Networks => {
                (output::POTENTIALS, [sizes.controllers, sizes.bases])
            }
        };
        GraphPorts {
            inputs,
            outputs: vec![(vertices, [3, sizes.vertices]), attributes],
        }
    }
}

impl Avatar {
    /// These parts of the deform graph as an ONNX model.
    ///
    /// The whole graph is the package's own, borrowed. Others are written from networks read back out of it, which takes
    /// about twice the package's size of memory while it lasts; keep the result as briefly as the runtime needs it.
    ///
    /// # Errors
    /// If the graph does not hold the networks in our form, which [`Self::load`] makes sure of.
    pub fn graph(&self, parts: GraphParts) -> Result<Cow<'_, [u8]>, PackageError> {
        if parts == GraphParts::Whole {
            return Ok(Cow::Borrowed(&self.deform_graph));
        }
        let (mesh, attributes) = (self.mesh_network()?, self.attribute_network()?);
        let graph = DeformGraph {
            template: &self.template,
            controllers: &self.controllers,
            mesh: &mesh,
            attributes: &attributes,
        };
        graph
            .to_onnx(parts)
            .map(Cow::Owned)
            .map_err(PackageError::graph_contents)
    }

    /// How many of everything the deform graph is made for.
    ///
    /// # Errors
    /// If the graph does not hold F_attr in our form, which [`Self::load`] makes sure of.
    pub fn graph_sizes(&self) -> Result<GraphSizes, PackageError> {
        Ok(GraphSizes {
            vertices: self.template.vertices().len(),
            gaussians: self.gaussians.len(),
            controllers: self.controllers.vertices().len(),
            bases: super::GraphSignature::read(&self.deform_graph)
                .map_err(PackageError::graph)?
                .bases
                .unwrap_or(0),
        })
    }

    /// F_mesh, read back from the deform graph; see [`MeshNetwork::read`].
    ///
    /// # Errors
    /// As [`Self::graph`].
    pub fn mesh_network(&self) -> Result<MeshNetwork, PackageError> {
        MeshNetwork::read(&self.deform_graph, &self.template).map_err(PackageError::graph)
    }

    /// F_attr, read back from the deform graph; see [`AttributeNetwork::read`].
    ///
    /// # Errors
    /// As [`Self::graph`].
    pub fn attribute_network(&self) -> Result<AttributeNetwork, PackageError> {
        AttributeNetwork::read(&self.deform_graph, &self.controllers).map_err(PackageError::graph)
    }
}
