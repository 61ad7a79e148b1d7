//! An avatar's deform graph and networks, read from its package.

use super::{Avatar, PackageError};
use crate::networks::{
    AttributeNetwork, DeformGraph, Dialect, GraphParts, GraphSignature, GraphSizes, MeshNetwork,
};
use std::borrow::Cow;

impl Avatar {
    /// These parts of the deform graph as an ONNX model of this dialect.
    ///
    /// The whole graph in the package's dialect is the package's own, borrowed. Others are written from networks read back out of it, which takes
    /// about twice the package's size of memory while it lasts; keep the result as briefly as the runtime needs it.
    ///
    /// # Errors
    /// If the graph does not hold the networks in our form, which [`Self::load`] makes sure of.
    pub fn graph(
        &self,
        parts: GraphParts,
        dialect: Dialect,
    ) -> Result<Cow<'_, [u8]>, PackageError> {
        if (parts, dialect) == (GraphParts::Whole, Dialect::Package) {
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
            .to_onnx_in(parts, dialect)
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
            bases: GraphSignature::read(&self.deform_graph)
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
