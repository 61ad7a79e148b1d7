//! The position offset that each controller causes, for L_guide (paper, section IV-C), and its derivatives.
//!
//! The paper writes Delta x_Phi_j without saying of which Gaussians. Here it is the mean over the Gaussians that controller j holds, by their
//! masses, of the position residual that its potentials alone would give them, turned from each triangle's frame in T-pose into the
//! template's axes so that offsets on different triangles compare: Delta x_j = sum_b u_j[b] D_j[b],
//! D_j[b] = sum_i m_ij R_i Delta x_i^b / sum_i m_ij.

use crate::bases::Hold;
use crate::planes::{for_each_run, planes_mut};
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use spmm3::NEIGHBOURS;

/// A vector for every controller that may hold a Gaussian.
pub(crate) const PULLS: usize = 3 * NEIGHBOURS;

/// D_j\[b\], row-major [B, C, 3]. `bases` begins with the three planes of position bases.
pub(crate) fn mean_bases(
    holds: &[Hold],
    rest_frames: &[Mat3],
    inverse_masses: &[f32],
    bases: &[f32],
    number_of_bases: usize,
    out: &mut Vec<f32>,
) {
    let (count, controllers) = (holds.len(), inverse_masses.len());
    out.clear();
    out.resize(number_of_bases * controllers * 3, 0.0);
    let rows = out.par_chunks_mut((3 * controllers).max(1)).enumerate();
    rows.for_each(|(basis, sums)| {
        let row = |axis: usize| {
            let start = (axis * number_of_bases + basis) * count;
            &bases[start..start + count]
        };
        let offsets = row(0).iter().zip(row(1)).zip(row(2));
        for ((hold, frame), ((x, y), z)) in holds.iter().zip(rest_frames).zip(offsets) {
            let turned = *frame * Vec3::new(*x, *y, *z);
            for (controller, mass) in hold.controllers.iter().zip(hold.masses) {
                let at = 3 * usize::from(*controller);
                for (sum, number) in sums[at..at + 3].iter_mut().zip(turned.to_array()) {
                    *sum += mass * number;
                }
            }
        }
        for (sums, inverse) in sums.chunks_exact_mut(3).zip(inverse_masses) {
            for sum in sums {
                *sum *= inverse;
            }
        }
    });
}

/// Delta x_j, row-major [C, 3], of potentials [C, B].
pub(crate) fn forward(
    potentials: &[f32],
    mean_bases: &[f32],
    number_of_bases: usize,
    out: &mut Vec<f32>,
) {
    let controllers = potentials.len() / number_of_bases.max(1);
    out.clear();
    out.resize(3 * controllers, 0.0);
    for (basis, means) in mean_bases
        .chunks_exact((3 * controllers).max(1))
        .enumerate()
    {
        let all = out.chunks_exact_mut(3).zip(means.chunks_exact(3));
        for (controller, (sums, mean)) in all.enumerate() {
            let potential = potentials[controller * number_of_bases + basis];
            for (sum, number) in sums.iter_mut().zip(mean) {
                *sum += potential * number;
            }
        }
    }
}

/// Adds the derivatives by the potentials, of those by the offsets ([C, 3]), to `by_potentials`.
pub(crate) fn backward(
    by_offsets: &[f32],
    mean_bases: &[f32],
    number_of_bases: usize,
    by_potentials: &mut [f32],
) {
    let rows = mean_bases.chunks_exact(by_offsets.len().max(1));
    for (basis, means) in rows.enumerate() {
        let all = by_offsets.chunks_exact(3).zip(means.chunks_exact(3));
        for (controller, (by, mean)) in all.enumerate() {
            by_potentials[controller * number_of_bases + basis] +=
                by[0] * mean[0] + by[1] * mean[1] + by[2] * mean[2];
        }
    }
}

/// What pulls at a Gaussian's position bases: (m_ij / sum m_j) R_i^T times the derivative by Delta x_j, for each of its three controllers;
/// row-major [3 coordinates, 3 controllers, N_g].
pub(crate) fn pulls(
    holds: &[Hold],
    rest_frames: &[Mat3],
    inverse_masses: &[f32],
    by_offsets: &[f32],
    out: &mut Vec<f32>,
) {
    out.resize(PULLS * holds.len(), 0.0);
    for_each_run(planes_mut::<PULLS>(out), &|start, out| {
        for at in 0..out[0].len() {
            let (hold, frame) = (&holds[start + at], &rest_frames[start + at]);
            for k in 0..NEIGHBOURS {
                let controller = usize::from(hold.controllers[k]);
                let by = Vec3::from_slice(&by_offsets[3 * controller..]);
                let share = hold.masses[k] * inverse_masses[controller];
                let pull = frame.transpose() * by * share;
                for (axis, number) in pull.to_array().into_iter().enumerate() {
                    out[axis * NEIGHBOURS + k][at] = number;
                }
            }
        }
    });
}

/// Adds the derivatives by one coordinate of one basis of the Gaussians from `start` on.
#[inline(always)]
pub(crate) fn add_pulls(
    holds: &[Hold],
    potentials: &[f32],
    pulls: &[f32],
    [axis, basis, number_of_bases]: [usize; 3],
    start: usize,
    out: &mut [f32],
) {
    let count = holds.len();
    let plane = |k: usize| &pulls[(axis * NEIGHBOURS + k) * count + start..][..out.len()];
    let planes = [plane(0), plane(1), plane(2)];
    for (at, (out, hold)) in out.iter_mut().zip(&holds[start..]).enumerate() {
        for (controller, plane) in hold.controllers.iter().zip(planes) {
            *out += potentials[usize::from(*controller) * number_of_bases + basis] * plane[at];
        }
    }
}
