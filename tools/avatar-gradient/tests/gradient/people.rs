//! A small person, and what tests do with it.

use avatar_gradient::{Model, Networks, Parameters, Posed};
use splat_gradient::Attributes;
use synthetic_person::{Puppet, PuppetSize, Random};

/// A person whose every array is small enough to be differentiated number by number.
pub(crate) const TINY: PuppetSize = PuppetSize {
    detail: 1,
    gaussians: 300,
    controllers: 12,
    controller_hidden: 3,
    bases: 4,
    mesh_hidden: 10,
    rank: 5,
};

/// A puppet, its model and its numbers.
pub(crate) struct Person {
    pub(crate) puppet: Puppet,
    pub(crate) model: Model,
    pub(crate) parameters: Parameters,
}

impl Person {
    pub(crate) fn new(size: PuppetSize) -> Self {
        let puppet = Puppet::new(size);
        let networks = Networks {
            gaussians: puppet.gaussians.clone(),
            mesh: puppet.mesh.clone(),
            attributes: puppet.attributes.clone(),
        };
        let model = Model::new(
            &puppet.skeleton,
            &puppet.template,
            &puppet.controllers,
            &networks,
        )
        .expect("the puppet's parts fit");
        Self {
            parameters: networks.parameters(),
            puppet,
            model,
        }
    }

    pub(crate) fn posed(&self, motion: &spmm3::MotionParams) -> Posed {
        let mut posed = Posed::new();
        self.model
            .pose(&self.parameters, motion, None, &mut posed)
            .expect("the parameters fit");
        posed
    }
}

/// So many numbers in -1..1.
pub(crate) fn random_numbers(count: usize, random: &mut Random) -> Vec<f32> {
    (0..count).map(|_| random.signed()).collect()
}

/// Derivatives by Gaussians.
pub(crate) fn random_attributes(count: usize, random: &mut Random) -> Attributes {
    Attributes::new(count, random_numbers(14 * count, random)).expect("14 planes")
}
