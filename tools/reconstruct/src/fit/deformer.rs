//! The stored networks run on the CPU, pose by pose: as the deform graph computes them, for measuring the fits.

use super::mesh::dense;
use super::{mesh_offsets, silu};
use glam::Vec3;
use rayon::prelude::*;
use spmm3::networks::{AttributeNetwork, MeshNetwork};
use spmm3::{ATTRIBUTES, Controllers, MotionParams, NEIGHBOURS};

/// F_mesh with its decoder widened.
#[derive(Debug)]
pub struct MeshRunner<'a> {
    network: &'a MeshNetwork,
    fields: Vec<f32>,
}

impl<'a> MeshRunner<'a> {
    /// Widens the decoder.
    #[must_use]
    pub fn new(network: &'a MeshNetwork) -> Self {
        Self {
            network,
            fields: network.decoder.dequantise(),
        }
    }

    /// Canonical offsets of one pose, the expression included, metres, `[N_v]`.
    #[must_use]
    pub fn offsets(&self, motion: &MotionParams) -> Vec<Vec3> {
        mesh_offsets(self.network, &self.fields, motion)
    }
}

/// Every controller's displacement potential for one pose, row-major `[controllers, B]`.
#[must_use]
pub fn potentials(network: &AttributeNetwork, motion: &MotionParams) -> Vec<f32> {
    let units: Vec<f32> = dense(&network.first, motion.values())
        .into_iter()
        .map(silu)
        .collect();
    let bases = network.bases.bases();
    let mut potentials = network.second_bias.clone();
    let hidden = network.hidden(potentials.len() / bases.max(1)).max(1);
    for ((units, weights), out) in units
        .chunks_exact(hidden)
        .zip(network.second.chunks_exact(hidden * bases))
        .zip(potentials.chunks_exact_mut(bases))
    {
        for (unit, row) in units.iter().zip(weights.chunks_exact(bases)) {
            for (sum, weight) in out.iter_mut().zip(row) {
                *sum += unit * weight.to_f32();
            }
        }
    }
    potentials
}

/// The dragging force on Gaussian `i`: its controllers' potentials mixed by virtual mass.
pub(super) fn force(
    controllers: &Controllers,
    potentials: &[f32],
    bases: usize,
    i: usize,
    out: &mut [f32],
) {
    out.fill(0.0);
    for k in 0..NEIGHBOURS {
        let (controller, mass) = (
            usize::from(controllers.neighbours()[i][k]),
            controllers.masses()[i][k],
        );
        for (sum, potential) in out
            .iter_mut()
            .zip(&potentials[controller * bases..(controller + 1) * bases])
        {
            *sum += mass * potential;
        }
    }
}

/// F_attr's residuals for one pose, row-major `[14, N_g]`; `full` are its dequantised bases.
#[must_use]
pub fn residuals(
    network: &AttributeNetwork,
    full: &[f32],
    controllers: &Controllers,
    motion: &MotionParams,
) -> Vec<f32> {
    let (bases, count) = (network.bases.bases(), network.bases.gaussians());
    let potentials = potentials(network, motion);
    let mut forces = vec![0.0f32; bases * count];
    let mut own = vec![0.0f32; bases];
    for i in 0..count {
        force(controllers, &potentials, bases, i, &mut own);
        for (b, f) in own.iter().enumerate() {
            forces[b * count + i] = *f;
        }
    }
    let mut out = vec![0.0f32; ATTRIBUTES * count];
    out.par_chunks_mut(count.max(1))
        .zip(full.par_chunks(bases * count.max(1)))
        .for_each(|(plane, basis)| {
            for (row, force) in basis.chunks_exact(count).zip(forces.chunks_exact(count)) {
                for ((sum, b), f) in plane.iter_mut().zip(row).zip(force) {
                    *sum += b * f;
                }
            }
        });
    out
}
