//! The terms of the loss that look at Gaussians and controllers instead of pictures (paper, section IV-C).

use crate::error::TrainError;
use crate::options::Weights;
use avatar_gradient::loss::{Pairs, Share, Surface, guide, scale};
use avatar_gradient::{Model, Parameters, Posed};
use splat_gradient::Attributes;
use spmm3::{BoundGaussians, Controllers, Template};

/// The terms cost as much as drawing does, and change slowly: L_scale and L_guide are taken in one step of so many, with a weight as many times as
/// large.
const EVERY: u8 = 4;
/// Of L_bind, each step takes one Gaussian of so many.
const BOUND_EVERY: u8 = 16;

/// What the terms need of a population, and their derivatives.
#[derive(Debug)]
pub(super) struct Regularisers {
    pairs: Pairs,
    surface: Surface,
    by_offsets: Vec<f32>,
    by_vertices: Vec<f32>,
}

/// The derivatives that are not by Gaussians.
#[derive(Debug, Clone, Copy)]
pub(super) struct Terms<'a> {
    pub(super) sum: f64,
    pub(super) by_offsets: Option<&'a [f32]>,
    pub(super) by_vertices: Option<&'a [f32]>,
}

impl Regularisers {
    pub(super) fn new(
        template: &Template,
        controllers: &Controllers,
        bound: &BoundGaussians,
    ) -> Result<Self, TrainError> {
        Ok(Self {
            pairs: Pairs::neighbouring(controllers),
            surface: Surface::new(template, bound)?,
            by_offsets: Vec::new(),
            by_vertices: vec![0.0; 3 * template.vertices().len()],
        })
    }

    /// Adds the terms of a step to the derivatives by Gaussians, and returns the others. The paper's sums are taken as means: over Gaussians, and over
    /// pairs of controllers.
    pub(super) fn add(
        &mut self,
        step: u64,
        (model, parameters): (&Model, &Parameters),
        posed: &mut Posed,
        weights: &Weights,
        by_gaussians: &mut Attributes,
    ) -> Result<Terms<'_>, TrainError> {
        let turn = step % u64::from(EVERY);
        let mut terms = Terms {
            sum: 0.0,
            by_offsets: None,
            by_vertices: None,
        };
        let gaussians = posed.gaussians();
        let each = weight_of_each(gaussians.len());
        if turn == 0 && weights.scale > 0.0 {
            let weight = f32::from(EVERY) * weights.scale * each;
            terms.sum += scale(gaussians, weights.scale_threshold, weight, by_gaussians)?;
        }
        if weights.bind > 0.0 {
            self.by_vertices.fill(0.0);
            terms.sum += self.surface.bind(
                (gaussians, posed.vertices()),
                Share::of_step(step, BOUND_EVERY),
                f32::from(BOUND_EVERY) * weights.bind * each,
                by_gaussians,
                &mut self.by_vertices,
            )?;
            terms.by_vertices = Some(&self.by_vertices);
        }
        if turn == 2 && weights.guide > 0.0 && model.parts.attributes {
            let offsets = model.controller_offsets(parameters, posed)?;
            self.by_offsets.clear();
            self.by_offsets.resize(offsets.len(), 0.0);
            let weight =
                f32::from(EVERY) * weights.guide * weight_of_each(self.pairs.pairs().len());
            terms.sum += guide(offsets, &self.pairs, weight, &mut self.by_offsets)?;
            terms.by_offsets = Some(&self.by_offsets);
        }
        Ok(terms)
    }
}

/// 1 / a count.
fn weight_of_each(count: usize) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "counts of Gaussians")]
    let count = count.max(1) as f32;
    1.0 / count
}
