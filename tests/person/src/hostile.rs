//! People made to be a burden: small packages that cost those who look at them much.

use crate::{Puppet, PuppetSize};
use spmm3::networks::{Dense, GraphParts, MeshNetwork};
use spmm3::{Avatar, BoundGaussians, PARAMS, Template, attribute};

/// The puppet as a cloud: so many Gaussians of one size, metres, half transparent. A package keeps less of it than [`spmm3::MOST_SCALE`].
///
/// # Panics
/// If the parts do not fit each other: a bug here.
#[must_use]
pub fn cloud(gaussians: usize, metres: f32) -> Avatar {
    let size = PuppetSize {
        gaussians,
        ..PuppetSize::SMALL
    };
    let puppet = Puppet::new(size).avatar();
    Avatar {
        gaussians: inflated(&puppet.template, &puppet.gaussians, metres),
        ..puppet
    }
}

/// These Gaussians, all of one size, metres, and half transparent.
///
/// # Panics
/// If they are out of range.
#[must_use]
pub fn inflated(template: &Template, gaussians: &BoundGaussians, metres: f32) -> BoundGaussians {
    let count = gaussians.len();
    let mut attributes = gaussians.attributes().to_vec();
    attributes[attribute::LOG_SCALE.start * count..attribute::LOG_SCALE.end * count]
        .fill(metres.ln());
    attributes[attribute::OPACITY * count..(attribute::OPACITY + 1) * count].fill(0.0);
    let (triangles, barycentrics) = (gaussians.triangles(), gaussians.barycentrics());
    let (triangles, barycentrics) = (triangles.to_vec(), barycentrics.to_vec());
    BoundGaussians::new(template, triangles, barycentrics, attributes).expect("in range")
}

/// The puppet with an `F_mesh` of so many hidden units and zeros alone: 2 bytes a weight for a program that loads it, and next to nothing in a package.
///
/// # Panics
/// If the parts do not fit each other: a bug here.
#[must_use]
pub fn hollow(hidden: usize) -> Avatar {
    let mut puppet = Puppet::small();
    let zeros = |inputs: usize, outputs: usize| {
        let weights = vec![0.0; inputs * outputs];
        Dense::new(inputs, outputs, &weights, vec![0.0; outputs]).expect("a layer's counts fit")
    };
    puppet.mesh = MeshNetwork {
        first: zeros(PARAMS, hidden),
        second: zeros(hidden, hidden),
        code: zeros(hidden, PuppetSize::SMALL.rank),
        decoder: puppet.mesh.decoder,
    };
    let graph = puppet.graph().to_onnx(GraphParts::Whole);
    Avatar {
        deform_graph: graph.expect("the networks fit"),
        ..puppet.avatar()
    }
}
