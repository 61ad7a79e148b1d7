//! Random networks with a visible, tame effect.

use super::{PuppetSize, Random};
use spmm3::networks::{AttributeNetwork, Dense, MeshNetwork, QuantisedBases, QuantisedDecoder};
use spmm3::{ATTRIBUTES, PARAMS, Template, attribute};

fn dense(inputs: usize, outputs: usize, gain: f32, random: &mut Random) -> Dense {
    let spread = gain / (inputs as f32).sqrt();
    let weights: Vec<f32> = (0..inputs * outputs)
        .map(|_| random.normal() * spread)
        .collect();
    let bias = (0..outputs).map(|_| random.signed() * 0.1).collect();
    Dense::new(inputs, outputs, &weights, bias).expect("a layer's counts fit")
}

/// Waves of about a centimetre that run over the body.
pub(super) fn mesh_network(
    template: &Template,
    size: PuppetSize,
    random: &mut Random,
) -> MeshNetwork {
    let vertices = template.vertices();
    let mut fields = Vec::with_capacity(size.rank * 3 * vertices.len());
    let amplitude = 0.003 / (size.rank as f32).sqrt();
    for _ in 0..size.rank {
        for _axis in 0..3 {
            let (wave, phase) = (random.vector() * 12.0, random.signed() * 3.0);
            fields.extend(
                vertices
                    .iter()
                    .map(|v| (wave.dot(*v) + phase).sin() * amplitude),
            );
        }
    }
    let mean = (0..3 * vertices.len())
        .map(|_| random.signed() * 1e-4)
        .collect();
    MeshNetwork {
        first: dense(PARAMS, size.mesh_hidden, 6.0, random),
        second: dense(size.mesh_hidden, size.mesh_hidden, 2.0, random),
        code: dense(size.mesh_hidden, size.rank, 2.0, random),
        decoder: QuantisedDecoder::quantise(size.rank, &fields, mean).expect("the decoder fits"),
    }
}

pub(super) fn attribute_network(size: PuppetSize, random: &mut Random) -> AttributeNetwork {
    let hidden = size.controllers * size.controller_hidden;
    let second: Vec<half::f16> = (0..hidden * size.bases)
        .map(|_| half::f16::from_f32(random.normal() / (size.controller_hidden as f32).sqrt()))
        .collect();
    let second_bias = (0..size.controllers * size.bases)
        .map(|_| random.signed() * 0.1)
        .collect();
    let mut bases = Vec::with_capacity(ATTRIBUTES * size.bases * size.gaussians);
    for plane in 0..ATTRIBUTES {
        // Metres, quaternion parts, log-metres, logits and colour coefficients: each visible, none wild.
        let reach = match plane {
            p if attribute::OFFSET.contains(&p) => 0.000_6,
            attribute::OPACITY => 0.05,
            _ => 0.015,
        };
        bases.extend((0..size.bases * size.gaussians).map(|_| random.normal() * reach));
    }
    AttributeNetwork {
        first: dense(PARAMS, hidden, 6.0, random),
        second,
        second_bias,
        bases: QuantisedBases::quantise(size.bases, size.gaussians, &bases).expect("the bases fit"),
    }
}
