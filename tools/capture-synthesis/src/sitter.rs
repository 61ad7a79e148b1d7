//! The person in a pose: the simulated surface in the world, with its normals and the light of the sky.

use crate::model::Model;
use glam::{Quat, Vec3};
use rayon::prelude::*;
use reconstruct::simulate::{Puppet, Simulator};
use reconstruct::{Light, Person};
use spmm3::{Joint, MotionParams, Skeleton};

/// The person's surface in one pose, in the world: metres, y up.
#[derive(Debug, Clone)]
pub struct Posed {
    /// `[N_v]`
    pub positions: Vec<Vec3>,
    /// `[N_v]` unit length; zero where no triangle is.
    pub normals: Vec<Vec3>,
    /// `[N_v]` factors by which the sky's light changes a colour; about 1 for an open surface that looks sideways.
    pub sky: Vec<Vec3>,
}

/// Poses one person.
#[derive(Debug)]
pub struct Sitter<'a> {
    skeleton: &'a Skeleton,
    simulator: Simulator<'a>,
    light: Light,
    shades: Vec<crate::model::Shade>,
}

impl<'a> Sitter<'a> {
    /// Prepares the simulation and the light of `person`, whose fabrics `puppet` has and whose materials `model`.
    #[must_use]
    pub fn new(person: &'a Person, puppet: &'a Puppet, model: &Model) -> Self {
        let casters = (model.faces.iter().zip(&model.materials))
            .filter(|(_, material)| material.casts)
            .map(|(face, _)| *face)
            .collect();
        Self {
            skeleton: person.skeleton(),
            simulator: Simulator::new(puppet),
            light: Light::sky(person.template(), casters),
            shades: model.shades.clone(),
        }
    }

    /// The simulated surface `[N_v]` in the world, metres. The cloth hangs as over an upright person: the simulation leaves the pelvis'
    /// orientation out, as the paper's networks do (section IV-B).
    #[must_use]
    pub fn positions(&self, motion: &MotionParams) -> Vec<Vec3> {
        let truth = self.simulator.simulate(motion);
        let (turn, hips, shift) = self.root(motion);
        (truth.posed.iter())
            .map(|point| turn * (*point - hips) + hips + shift)
            .collect()
    }

    /// Where the 55 joints are in the world, metres.
    #[must_use]
    pub fn joints(&self, motion: &MotionParams) -> Vec<Vec3> {
        let joints = self.skeleton.pose(motion);
        Joint::ALL
            .map(|joint| joints.position(joint) + motion.root_translation)
            .to_vec()
    }

    /// Normals and light of a surface that [`Self::positions`] gave.
    #[must_use]
    pub fn lit(&self, positions: Vec<Vec3>) -> Posed {
        let mut sky = self.light.factors(&positions);
        for (factor, shade) in sky.iter_mut().zip(&self.shades) {
            let shaded = Vec3::ONE.lerp(*factor, shade.strength);
            *factor = shaded.max(Vec3::splat(shade.floor)) * shade.depth;
        }
        Posed {
            normals: self.simulator.surface().normals(&positions),
            positions,
            sky,
        }
    }

    /// The surfaces of many poses; `done` is called after each.
    pub fn all(&self, motions: &[MotionParams], done: impl Fn() + Sync) -> Vec<Vec<Vec3>> {
        motions
            .par_iter()
            .map(|motion| {
                let positions = self.positions(motion);
                done();
                positions
            })
            .collect()
    }

    /// The pelvis' orientation, the rest position it turns about, and how far it is from there.
    fn root(&self, motion: &MotionParams) -> (Quat, Vec3, Vec3) {
        (
            motion.rotation(Joint::Pelvis),
            self.skeleton.rest_positions()[Joint::Pelvis.index()],
            motion.root_translation,
        )
    }
}
