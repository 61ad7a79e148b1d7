//! Reads F_mesh and F_attr back out of a deform graph that [`super::DeformGraph`] wrote, by the names of their
//! tensors: for a unit that runs part of the graph with kernels of its own.

use super::inspect::Stored;
use super::wire::Checked;
use super::wire::GraphRefused;
use super::{AttributeNetwork, Dense, MeshNetwork, QuantisedBases, QuantisedDecoder};
use crate::{ATTRIBUTES, Controllers, PersonError, Template};

fn inconsistent(error: PersonError) -> GraphRefused {
    GraphRefused(error.to_string())
}

/// A fully connected layer by its name.
fn dense(model: &[u8], name: &str) -> Checked<Dense> {
    let weights = Stored::find(model, &format!("{name}.weights"))?;
    let bias = Stored::find(model, &format!("{name}.bias"))?;
    let [inputs, outputs] = weights.shape()?;
    Dense::from_stored(inputs, outputs, weights.halves()?, bias.floats()?).map_err(inconsistent)
}

impl MeshNetwork {
    /// F_mesh of `model`, a deform graph for `template`. The graph stores rest shape and mean offsets as one sum, so that
    /// the mean comes back to within the sum's rounding (0.1 um).
    ///
    /// # Errors
    /// If the graph does not hold the network in our form, or it does not fit the template.
    pub fn read(model: &[u8], template: &Template) -> Result<Self, GraphRefused> {
        let values = Stored::find(model, "mesh.decoder.values")?;
        let [rank, _] = values.shape()?;
        let rest = (0..3).flat_map(|axis| template.vertices().iter().map(move |v| v[axis]));
        let mut mean = Stored::find(model, "mesh.canonical")?.floats()?;
        for (canonical, rest) in mean.iter_mut().zip(rest) {
            *canonical -= rest;
        }
        let decoder = QuantisedDecoder::from_stored(
            rank,
            Stored::find(model, "mesh.decoder.unit")?.floats()?,
            Stored::find(model, "mesh.decoder.scales")?.halves()?,
            values.bytes()?,
            mean,
        )
        .map_err(inconsistent)?;
        let network = Self {
            first: dense(model, "mesh.first")?,
            second: dense(model, "mesh.second")?,
            code: dense(model, "mesh.code")?,
            decoder,
        };
        let count = template.vertices().len();
        network.check(count).map_err(inconsistent)?;
        Ok(network)
    }
}

impl AttributeNetwork {
    /// F_attr of `model`, a deform graph for `controllers`; exactly what was written.
    ///
    /// # Errors
    /// If the graph does not hold the network in our form, or it does not fit the controllers and their Gaussians.
    pub fn read(model: &[u8], controllers: &Controllers) -> Result<Self, GraphRefused> {
        let values = Stored::find(model, "attr.bases.values")?;
        let [_, bases, _] = values.shape()?;
        let units = Stored::find(model, "attr.bases.units")?.floats()?;
        let units: [f32; ATTRIBUTES] = units[..]
            .try_into()
            .map_err(|_| GraphRefused("not one unit for each attribute".into()))?;
        let scales = Stored::find(model, "attr.bases.scales")?.halves()?;
        let network = Self {
            first: dense(model, "attr.first")?,
            second: Stored::find(model, "attr.second.weights")?.halves()?,
            second_bias: Stored::find(model, "attr.second.bias")?.floats()?,
            bases: QuantisedBases::from_stored(bases, units, scales, values.bytes()?)
                .map_err(inconsistent)?,
        };
        network
            .check(controllers.vertices().len(), controllers.neighbours().len())
            .map_err(inconsistent)?;
        Ok(network)
    }
}
