//! Gaussians come and go: every array that has one number for each of them follows.

use super::optimiser::GAUSSIANS;
use super::regularise::Regularisers;
use super::{Memory, Trainer};
use crate::density::{Change, Plan, Population, Surface, plan};
use crate::error::TrainError;
use crate::random::mixed;
use crate::schedule::{DENSIFY, Phase};
use avatar_gradient::{Model, Parameters};
use glam::Vec3;
use spmm3::{BoundGaussians, Controllers};

/// How often the population changes.
const ROUNDS: u32 = 24;
/// After so much of the rounds there are as many Gaussians as may be; later ones only move from where nothing is seen of them.
const GROWN: u32 = 16;
/// Steps that are waited for, so that most pictures had a say.
const LEAST_STEPS: u32 = 60;
/// No round adds a larger share.
const MOST_GROWTH: f32 = 0.25;
/// A round that moves Gaussians about moves such a share.
const MOVED: f32 = 0.02;
/// Seeds of rounds follow those of rounds of pictures.
const FIRST_SEED: u64 = 1 << 40;

impl Trainer<'_> {
    /// Leaves out Gaussians beyond the budget.
    pub(super) fn keep_to_budget(&mut self) -> Result<(), TrainError> {
        let (count, budget) = (self.bound.len(), self.options.gaussians);
        if count <= budget {
            return Ok(());
        }
        let plan = plan(&self.parameters.gaussians, &self.statistics, 0, 0, budget);
        self.carry_out(&plan, 0)
    }

    /// Makes a round if one is due after a step of `phase`.
    pub(super) fn change_population(
        &mut self,
        progress: f32,
        phase: &Phase,
    ) -> Result<(), TrainError> {
        let done = ((progress - DENSIFY.start) / (DENSIFY.end - DENSIFY.start)).clamp(0.0, 1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a share of a few rounds"
        )]
        let due = (done * ROUNDS as f32) as u32;
        if !phase.densify || self.unchanged < LEAST_STEPS || due <= self.rounds {
            return Ok(());
        }
        let (count, budget) = (self.bound.len(), self.options.gaussians);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "shares of counts"
        )]
        let share = |of: f32| (count as f32 * of) as usize;
        let left = GROWN.saturating_sub(self.rounds).max(1) as usize;
        let more = (budget.saturating_sub(count) / left).min(share(MOST_GROWTH));
        let more = more.max(share(MOVED));
        let plan = plan(
            &self.parameters.gaussians,
            &self.statistics,
            self.unchanged,
            more,
            budget,
        );
        if plan.is_empty(count) {
            self.statistics.reset(count);
        } else {
            log::debug!(
                "step {}: {} of {count} Gaussians stay, {} are split, {} cloned",
                self.step,
                plan.kept.len(),
                plan.split.len(),
                plan.cloned.len()
            );
            self.carry_out(&plan, due)?;
        }
        self.rounds = due;
        self.unchanged = 0;
        Ok(())
    }

    /// Carries out a plan, as the round of this number; on an error nothing has changed.
    pub(super) fn carry_out(&mut self, plan: &Plan, round: u32) -> Result<(), TrainError> {
        let template = &self.first.template;
        let before = self.bound.len();
        // Where clothes are, the mesh is centimetres off the template.
        let vertices = displaced(template.vertices(), &self.parameters.mesh_mean);
        let surface = Surface::new(&vertices, template.faces());
        let population = Population {
            triangles: self.bound.triangles(),
            barycentrics: self.bound.barycentrics(),
            attributes: &self.parameters.gaussians,
        };
        let seed = mixed(self.options.seed, FIRST_SEED + u64::from(round));
        let mut change = Change::new(plan, population, &surface, seed);
        let neighbours = self.controllers.neighbours();
        // Each controller's Gaussians lie together, as the receiver's graph gathers them.
        change.sort_by_key(|origin, triangle| (neighbours[origin as usize], triangle));
        let pick = |i: &u32| neighbours[*i as usize];
        let masses = self.controllers.masses();
        let controllers = Controllers::new(
            template,
            self.controllers.vertices().to_vec(),
            change.origin.iter().map(pick).collect(),
            change.origin.iter().map(|i| masses[*i as usize]).collect(),
        )?;
        let bound = BoundGaussians::new(
            template,
            change.triangles.clone(),
            change.barycentrics.clone(),
            change.attributes.clone(),
        )?;

        let each = self.model.sizes().bases;
        let parameters = Parameters {
            bases: change.bases(&self.parameters.bases, before, each),
            gaussians: change.attributes.clone(),
            ..self.parameters.clone()
        };
        let networks = parameters.to_networks(template, &controllers, &bound)?;
        let model = Model::new(&self.first.skeleton, template, &controllers, &networks)?;
        let regularisers = Regularisers::new(template, &controllers, &bound)?;

        // From here on nothing can fail.
        let arrays = parameters.arrays();
        for ((name, _), adam) in arrays.into_iter().zip(&mut self.optimiser.arrays) {
            if name == GAUSSIANS {
                adam.first = change.remembered(&adam.first, before);
                adam.second = change.remembered(&adam.second, before);
            }
        }
        let moments = &mut self.optimiser.bases;
        moments.first = change.remembered(&moments.first, before);
        moments.second = change.remembered(&moments.second, before);
        self.statistics.reset(bound.len());
        self.parameters = parameters;
        self.regularisers = regularisers;
        self.bound = bound;
        self.controllers = controllers;
        self.memory = Memory::new(&model);
        self.model = model;
        Ok(())
    }
}

/// The template's vertices with F_mesh's mean offsets (planes x|y|z), metres.
fn displaced(vertices: &[Vec3], mean: &[f32]) -> Vec<Vec3> {
    let plane = |axis: usize| mean.iter().skip(axis * vertices.len());
    let offsets = plane(0).zip(plane(1)).zip(plane(2));
    (vertices.iter().zip(offsets))
        .map(|(vertex, ((x, y), z))| *vertex + Vec3::new(*x, *y, *z))
        .collect()
}
