//! Adam's step of the deformation bases, whose derivatives are never stored.

use crate::error::{ModelError, check_count};
use crate::model::Model;
use crate::planes::RUN;
use crate::posed::Posed;
use rayon::prelude::*;
use splat_gradient::adam::{Adam, Step};
use spmm3::ATTRIBUTES;
use std::ops::Range;

/// Neighbouring Gaussians that a step of [`Moved::Seen`] takes or leaves together: a line of the processor's cache.
const GROUP: usize = 16;

/// Which bases a step moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moved {
    /// All, as Adam has it: those without a derivative go on by their momentum.
    All,
    /// Groups of 16 neighbouring Gaussians of which one has a derivative by opacity or colour, which only pictures give; the others'
    /// numbers and moments stay. Bases of Gaussians that a picture does not show are left alone. It is cheaper where
    /// thousands of neighbours are seen or hidden together: Gaussians in the order of the surface.
    Seen,
}

/// Makes a step of the bases down the gradient that the last [`Model::backward`] of `posed` found: the same as [`Adam::step`] by
/// `gradients.bases`. `rates` has a learning rate for each attribute plane; at 0 its bases and their moments stay.
///
/// The bases are nine tenths of an avatar's numbers. Their derivatives by one pose are products of small arrays, which the step multiplies
/// as it goes: it reads and writes the bases and Adam's moments, row-major [14, B, N_g] each, once, and nothing else of that size exists.
///
/// Runs on rayon's current pool.
///
/// # Errors
/// Bases or moments of another size than the model's; a pose without derivatives or without F_attr. Nothing has changed then.
pub fn step_bases(
    adam: &mut Adam,
    bases: &mut [f32],
    model: &Model,
    posed: &Posed,
    rates: &[f32; ATTRIBUTES],
    moved: Moved,
) -> Result<(), ModelError> {
    let derivatives = model.basis_derivatives(posed);
    if !derivatives.fit(bases.len()) {
        return Err(ModelError::NotPosed("derivatives by the bases"));
    }
    check_count("the bases' first moments", adam.first.len(), bases.len())?;
    check_count("the bases' second moments", adam.second.len(), bases.len())?;
    adam.steps = adam.steps.saturating_add(1);
    let (count, rows) = (derivatives.holds.len(), derivatives.number_of_bases);
    let stretches = match moved {
        Moved::All => stretches(count, |_| true),
        Moved::Seen => stretches(count, |gaussian| derivatives.seen(gaussian)),
    };
    let steps = rates.map(|rate| Step::new(adam.steps, rate));
    let numbers = bases.par_chunks_mut(count.max(1));
    let firsts = adam.first.par_chunks_mut(count.max(1));
    let seconds = adam.second.par_chunks_mut(count.max(1));
    let all = numbers.zip(firsts.zip(seconds)).enumerate();
    all.for_each(|(row, (numbers, (firsts, seconds)))| {
        let plane = row / rows;
        if rates[plane] == 0.0 {
            return;
        }
        let mut buffer = [0.0; RUN];
        for range in &stretches {
            let gradients = &mut buffer[..range.len()];
            gradients.fill(0.0);
            derivatives.add_to(row, range.start, gradients);
            steps[plane].take(
                &mut numbers[range.clone()],
                gradients,
                &mut firsts[range.clone()],
                &mut seconds[range.clone()],
            );
        }
    });
    Ok(())
}

/// Gaussians of the groups of which one is wanted, in stretches of at most [`RUN`].
fn stretches(count: usize, wanted: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut stretches: Vec<Range<usize>> = Vec::new();
    for start in (0..count).step_by(GROUP) {
        let group = start..count.min(start + GROUP);
        if !group.clone().any(&wanted) {
            continue;
        }
        match stretches.last_mut() {
            Some(last) if last.end == start && last.len() < RUN => last.end = group.end,
            _ => stretches.push(group),
        }
    }
    stretches
}
