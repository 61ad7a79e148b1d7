//! F_attr's tail (paper, section IV-B): controllers' potentials -> dragging forces -> residuals, and the derivatives.
//!
//! F_i = sum of three masses times potentials, Delta G_i = sum_b F_i[b] Delta G_i^b. The bases are the largest array of an avatar
//! (10.5 million numbers at 50,000 Gaussians), so each pass reads them once. The derivatives by a Gaussian's bases are the products of its
//! derivatives by the residuals and its forces.

use crate::planes::{RUN, add_products};
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;
use spmm3::{ATTRIBUTES, Controllers, NEIGHBOURS};

/// Which controllers pull a Gaussian, and how strongly.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hold {
    pub(crate) controllers: [u16; NEIGHBOURS],
    pub(crate) masses: [f32; NEIGHBOURS],
}

/// Of every Gaussian.
pub(crate) fn holds(controllers: &Controllers) -> Vec<Hold> {
    let pairs = controllers.neighbours().iter().zip(controllers.masses());
    let hold = pairs.map(|(controllers, masses)| Hold {
        controllers: *controllers,
        masses: *masses,
    });
    hold.collect()
}

/// Dragging forces, row-major [B, N_g], of potentials [C, B].
pub(crate) fn forces(holds: &[Hold], potentials: &[f32], bases: usize, out: &mut Vec<f32>) {
    let count = holds.len();
    out.resize(bases * count, 0.0);
    let planes = out.par_chunks_mut(count.max(1)).enumerate();
    planes.for_each(|(basis, plane)| {
        let runs = plane.par_chunks_mut(RUN).zip(holds.par_chunks(RUN));
        runs.for_each(|(forces, holds)| {
            for (force, hold) in forces.iter_mut().zip(holds) {
                let [first, second, third] = hold
                    .controllers
                    .map(|c| potentials[usize::from(c) * bases + basis]);
                let [a, b, c] = hold.masses;
                *force = a * first + b * second + c * third;
            }
        });
    });
}

/// Adds the derivatives by the potentials, of those by the forces ([B, N_g]), to `by_potentials` ([C, B]); `by_basis` is memory.
pub(crate) fn forces_backward(
    holds: &[Hold],
    by_forces: &[f32],
    bases: usize,
    by_basis: &mut Vec<f32>,
    by_potentials: &mut [f32],
) {
    let controllers = by_potentials.len() / bases.max(1);
    by_basis.clear();
    by_basis.resize(by_potentials.len(), 0.0);
    // Each basis has sums of its own, added up in the order of the Gaussians.
    by_basis
        .par_chunks_mut(controllers.max(1))
        .zip(by_forces.par_chunks(holds.len().max(1)))
        .for_each(|(sums, by_forces)| {
            for (hold, by) in holds.iter().zip(by_forces) {
                for (controller, mass) in hold.controllers.iter().zip(hold.masses) {
                    sums[usize::from(*controller)] += mass * by;
                }
            }
        });
    for (basis, sums) in by_basis.chunks(controllers.max(1)).enumerate() {
        for (controller, sum) in sums.iter().enumerate() {
            by_potentials[controller * bases + basis] += sum;
        }
    }
}

/// Template attributes plus residuals, row-major [14, N_g]. No forces: the template's alone.
pub(crate) fn attributes(
    level: Level,
    template: &[f32],
    bases: &[f32],
    forces: &[f32],
    out: &mut Vec<f32>,
) {
    out.resize(template.len(), 0.0);
    let count = (template.len() / ATTRIBUTES).max(1);
    let planes = out.par_chunks_mut(count).zip(template.par_chunks(count));
    planes.enumerate().for_each(|(plane, (out, template))| {
        let plane_of_bases = &bases[plane * forces.len()..(plane + 1) * forces.len()];
        let runs = out.par_chunks_mut(RUN).zip(template.par_chunks(RUN));
        runs.enumerate().for_each(|(run, (out, template))| {
            dispatch!(level, simd => {
                let _ = simd;
                let range = run * RUN..run * RUN + out.len();
                out.copy_from_slice(template);
                let rows = plane_of_bases.chunks_exact(count).zip(forces.chunks_exact(count));
                for (basis, force) in rows {
                    add_products(out, &basis[range.clone()], &force[range.clone()]);
                }
            });
        });
    });
}

/// Derivatives by the forces, row-major [B, N_g], of those by the attributes ([14, N_g]).
pub(crate) fn attributes_backward(
    level: Level,
    bases: &[f32],
    by_attributes: &[f32],
    number_of_bases: usize,
    by_forces: &mut Vec<f32>,
) {
    let count = (by_attributes.len() / ATTRIBUTES).max(1);
    by_forces.resize(by_attributes.len() / ATTRIBUTES * number_of_bases, 0.0);
    let planes = by_forces.par_chunks_mut(count).enumerate();
    planes.for_each(|(basis, out)| {
        let runs = out.par_chunks_mut(RUN).enumerate();
        runs.for_each(|(run, out)| {
            dispatch!(level, simd => {
                let _ = simd;
                let range = run * RUN..run * RUN + out.len();
                out.fill(0.0);
                for (plane, by) in by_attributes.chunks_exact(count).enumerate() {
                    let row = (plane * number_of_bases + basis) * count;
                    add_products(out, &bases[row..row + count][range.clone()], &by[range.clone()]);
                }
            });
        });
    });
}
