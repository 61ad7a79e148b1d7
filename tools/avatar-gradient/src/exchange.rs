//! Parameters from the networks of a package, and networks as a package stores them from parameters.

use crate::error::ModelError;
use crate::parameters::{Layer, Parameters, Sizes};
use half::f16;
use spmm3::networks::{AttributeNetwork, Dense, MeshNetwork, QuantisedBases, QuantisedDecoder};
use spmm3::{BoundGaussians, Controllers, PARAMS, Template};

/// What an avatar's package stores of [`Parameters`]: `spmm3::networks::DeformGraph` makes its graph.
#[derive(Debug, Clone, PartialEq)]
pub struct Networks {
    /// Rounded to half precision.
    pub gaussians: BoundGaussians,
    /// F_mesh.
    pub mesh: MeshNetwork,
    /// F_attr.
    pub attributes: AttributeNetwork,
}

impl Networks {
    /// The sizes that follow from these networks, on a template of `vertices` vertices and with so many controllers.
    ///
    /// # Errors
    /// Networks that do not fit the Gaussians, the vertices or the controllers.
    pub fn sizes(&self, vertices: usize, controllers: usize) -> Result<Sizes, ModelError> {
        self.mesh.check(vertices)?;
        self.attributes.check(controllers, self.gaussians.len())?;
        Ok(Sizes {
            gaussians: self.gaussians.len(),
            vertices,
            controllers,
            controller_hidden: self.attributes.hidden(controllers),
            bases: self.attributes.bases.bases(),
            mesh_hidden: [self.mesh.first.outputs(), self.mesh.second.outputs()],
            rank: self.mesh.code.outputs(),
        })
    }

    /// All numbers, widened.
    #[must_use]
    pub fn parameters(&self) -> Parameters {
        Parameters {
            gaussians: self.gaussians.attributes().to_vec(),
            bases: self.attributes.bases.dequantise(),
            controllers_first: widened(&self.attributes.first),
            controllers_second: self.attributes.second.iter().map(|w| w.to_f32()).collect(),
            controllers_second_bias: self.attributes.second_bias.clone(),
            mesh_first: widened(&self.mesh.first),
            mesh_second: widened(&self.mesh.second),
            mesh_code: widened(&self.mesh.code),
            mesh_fields: self.mesh.decoder.dequantise(),
            mesh_mean: self.mesh.decoder.mean().to_vec(),
        }
    }
}

impl Parameters {
    /// The networks, quantised as a package stores them: half precision for Gaussians and layers, 8 bits for bases and fields.
    /// `bound` says where the Gaussians are bound.
    ///
    /// # Errors
    /// Arrays of other sizes; numbers that are not finite or beyond what a package may hold.
    pub fn to_networks(
        &self,
        template: &Template,
        controllers: &Controllers,
        bound: &BoundGaussians,
    ) -> Result<Networks, ModelError> {
        let count = bound.len();
        let gaussians = BoundGaussians::new(
            template,
            bound.triangles().to_vec(),
            bound.barycentrics().to_vec(),
            self.gaussians.clone(),
        )?
        .quantised();
        let controllers = controllers.vertices().len();
        let number_of_bases = self.controllers_second_bias.len() / controllers.max(1);
        let units = self.controllers_first.bias.len();
        // A second layer beyond half precision is refused, as the other layers are.
        let second = Dense::new(
            units,
            number_of_bases,
            &self.controllers_second,
            vec![0.0; number_of_bases],
        )?;
        let attributes = AttributeNetwork {
            first: dense(PARAMS, &self.controllers_first)?,
            second: second.weights().to_vec(),
            second_bias: self.controllers_second_bias.clone(),
            bases: QuantisedBases::quantise(number_of_bases, count, &self.bases)?,
        };
        attributes.check(controllers, count)?;
        let rank = self.mesh_code.bias.len();
        let mesh = MeshNetwork {
            first: dense(PARAMS, &self.mesh_first)?,
            second: dense(self.mesh_first.bias.len(), &self.mesh_second)?,
            code: dense(self.mesh_second.bias.len(), &self.mesh_code)?,
            decoder: QuantisedDecoder::quantise(rank, &self.mesh_fields, self.mesh_mean.clone())?,
        };
        mesh.check(template.vertices().len())?;
        Ok(Networks {
            gaussians,
            mesh,
            attributes,
        })
    }
}

fn widened(layer: &Dense) -> Layer {
    Layer {
        weights: layer.weights().iter().copied().map(f16::to_f32).collect(),
        bias: layer.bias().to_vec(),
    }
}

fn dense(inputs: usize, layer: &Layer) -> Result<Dense, ModelError> {
    Ok(Dense::new(
        inputs,
        layer.bias.len(),
        &layer.weights,
        layer.bias.clone(),
    )?)
}
