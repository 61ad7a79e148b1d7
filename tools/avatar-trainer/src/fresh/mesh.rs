//! F_mesh with room for what a person's clothes do.

use super::inputs::InputStatistics;
use crate::random::normal;
use spmm3::networks::{Dense, MeshNetwork, QuantisedDecoder};
use spmm3::{BODY, PARAMS, PersonError};

/// Hidden units that are added.
pub const MESH_HIDDEN: usize = 64;
/// Offset fields that are added.
pub const MESH_FIELDS: usize = 24;

/// `mesh` with [`MESH_HIDDEN`] more hidden units in each layer, which are random features of the body's pose, and [`MESH_FIELDS`] more fields
/// of offsets that they drive, all 0: so it gives the very offsets that it gave.
///
/// # Errors
/// Numbers that do not make a network, which takes motions that are not finite.
pub fn widened(
    mesh: &MeshNetwork,
    inputs: &InputStatistics,
    seed: u64,
) -> Result<MeshNetwork, PersonError> {
    let mut rng = fastrand::Rng::with_seed(seed);
    #[expect(clippy::cast_precision_loss, reason = "few units")]
    let spread = |count: usize| 1.0 / (count as f32).sqrt();
    let mut weights = vec![0.0; PARAMS * MESH_HIDDEN];
    let mut bias = vec![0.0; MESH_HIDDEN];
    for input in 0..BODY {
        for unit in 0..MESH_HIDDEN {
            let weight = normal(&mut rng) * spread(BODY) / inputs.spread[input];
            weights[input * MESH_HIDDEN + unit] = weight;
            bias[unit] -= weight * inputs.mean[input];
        }
    }
    let mut square = |rows: usize, columns: usize| -> Vec<f32> {
        (0..rows * columns)
            .map(|_| normal(&mut rng) * 1.5 * spread(rows))
            .collect()
    };
    let second = square(MESH_HIDDEN, MESH_HIDDEN);
    let code = square(MESH_HIDDEN, MESH_FIELDS);
    let columns = mesh.decoder.mean().len();
    let mut fields = mesh.decoder.dequantise();
    fields.resize(fields.len() + MESH_FIELDS * columns, 0.0);
    let rank = mesh.decoder.rank() + MESH_FIELDS;
    Ok(MeshNetwork {
        first: beside(&mesh.first, 0, &weights, &bias)?,
        second: beside(&mesh.second, MESH_HIDDEN, &second, &[0.0; MESH_HIDDEN])?,
        code: beside(&mesh.code, MESH_HIDDEN, &code, &[0.0; MESH_FIELDS])?,
        decoder: QuantisedDecoder::quantise(rank, &fields, mesh.decoder.mean().to_vec())?,
    })
}

/// `layer` and another one side by side. The other's inputs are `more_inputs` further ones, or at 0 the same.
fn beside(
    layer: &Dense,
    more_inputs: usize,
    weights: &[f32],
    bias: &[f32],
) -> Result<Dense, PersonError> {
    let (inputs, outputs) = (layer.inputs(), layer.outputs());
    let all = outputs + bias.len();
    let mut joined = vec![0.0; (inputs + more_inputs) * all];
    for (row, own) in layer.weights().chunks_exact(outputs.max(1)).enumerate() {
        for (out, weight) in joined[row * all..].iter_mut().zip(own) {
            *out = weight.to_f32();
        }
    }
    let first = if more_inputs == 0 { 0 } else { inputs };
    for (row, own) in weights.chunks_exact(bias.len().max(1)).enumerate() {
        let start = (first + row) * all + outputs;
        joined[start..start + own.len()].copy_from_slice(own);
    }
    let bias = layer.bias().iter().chain(bias).copied().collect();
    Dense::new(inputs + more_inputs, all, &joined, bias)
}

#[cfg(test)]
mod tests {
    use super::*;
    use spmm3::MotionParams;
    use synthetic_person::{Puppet, Random};

    /// F_mesh's offsets, written out in f64.
    fn offsets(mesh: &MeshNetwork, motion: &MotionParams) -> Vec<f64> {
        let layer = |layer: &Dense, x: &[f64], silu: bool| -> Vec<f64> {
            (0..layer.outputs())
                .map(|o| {
                    let weights = layer.weights().iter().skip(o).step_by(layer.outputs());
                    let sum: f64 = x
                        .iter()
                        .zip(weights)
                        .map(|(x, w)| x * f64::from(w.to_f32()))
                        .sum::<f64>()
                        + f64::from(layer.bias()[o]);
                    if silu {
                        sum / (1.0 + (-sum).exp())
                    } else {
                        sum
                    }
                })
                .collect()
        };
        let x: Vec<f64> = motion.values().iter().map(|x| f64::from(*x)).collect();
        let hidden = layer(&mesh.second, &layer(&mesh.first, &x, true), true);
        let code = layer(&mesh.code, &hidden, false);
        let columns = mesh.decoder.mean().len();
        let fields = mesh.decoder.dequantise();
        (0..columns)
            .map(|c| {
                let moved: f64 = code
                    .iter()
                    .enumerate()
                    .map(|(r, code)| code * f64::from(fields[r * columns + c]))
                    .sum();
                moved + f64::from(mesh.decoder.mean()[c])
            })
            .collect()
    }

    #[test]
    fn a_widened_network_gives_the_offsets_that_it_gave() {
        let puppet = Puppet::small();
        let mut random = Random::new(6);
        let motions: Vec<MotionParams> = (0..5).map(|_| random.motion(0.4)).collect();
        let inputs = InputStatistics::new(motions.iter());
        let wide = widened(&puppet.mesh, &inputs, 1).expect("a network");
        wide.check(puppet.template.vertices().len())
            .expect("it fits");
        for motion in &motions {
            let (before, after) = (offsets(&puppet.mesh, motion), offsets(&wide, motion));
            for (before, after) in before.iter().zip(&after) {
                assert!((before - after).abs() < 2e-5, "{before}, {after}");
            }
        }
    }
}
