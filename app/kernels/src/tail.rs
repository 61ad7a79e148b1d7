//! F_attr's tail: controllers' potentials -> a block's 14 residuals, without a round through memory.
//!
//! `Delta G_i = sum_b F_i[b] Delta G_i^b`, F_i mixed from three controllers' potentials by virtual mass (paper, section
//! IV-B). The bases stay in 8 bits until they are multiplied by the force, so that no more is read than the package holds.

use super::{BLOCK, Sixteen};
use fearless_simd::{f32x16, prelude::*};
use rayon::prelude::*;
use spmm3::networks::{AttributeNetwork, QuantisedBases};
use spmm3::{ATTRIBUTES, Controllers, NEIGHBOURS};

/// A block's 14 residuals.
pub(super) type Residuals = [Sixteen; ATTRIBUTES];

/// The tail's tables for 16 Gaussians, without their bases.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Held {
    scales: [Sixteen; ATTRIBUTES],
    masses: [[f32; NEIGHBOURS]; BLOCK],
    neighbours: [[u16; NEIGHBOURS]; BLOCK],
}

/// Bases that are weighed together.
const ROWS: usize = 8;
/// One plane of eight bases of a block's Gaussians; those past the last basis are nothing.
type Rows = [[i8; BLOCK]; ROWS];

/// F_attr after its controllers, laid out block after block.
#[derive(Debug, Clone)]
pub(super) struct Tail {
    controllers: usize,
    bases: usize,
    held: Vec<Held>,
    /// `[blocks][14][B / 8, rounded up]`.
    values: Vec<Rows>,
}

impl Tail {
    /// The network fits the controllers (`AttributeNetwork::check`).
    pub(super) fn new(network: &AttributeNetwork, controllers: &Controllers) -> Self {
        let quantised = &network.bases;
        let (bases, gaussians) = (quantised.bases(), quantised.gaussians());
        let blocks = gaussians.div_ceil(BLOCK);
        let per_plane = bases.div_ceil(ROWS);
        let mut values = vec![[[0; BLOCK]; ROWS]; blocks * ATTRIBUTES * per_plane];
        if bases > 0 {
            values
                .par_chunks_exact_mut(ATTRIBUTES * per_plane)
                .enumerate()
                .for_each(|(block, values)| {
                    let range = block * BLOCK..gaussians.min((block + 1) * BLOCK);
                    let planes = quantised.values().chunks(bases * gaussians);
                    for (rows, plane) in values.chunks_exact_mut(per_plane).zip(planes) {
                        let rows = rows.as_flattened_mut().iter_mut();
                        for (row, all) in rows.zip(plane.chunks(gaussians)) {
                            row[..range.len()].copy_from_slice(&all[range.clone()]);
                        }
                    }
                });
        }
        Self {
            controllers: controllers.vertices().len(),
            bases,
            held: (0..blocks)
                .map(|block| Held::new(quantised, controllers, block * BLOCK))
                .collect(),
            values,
        }
    }

    /// How many potentials there are: C x B.
    pub(super) fn potentials(&self) -> usize {
        self.controllers * self.bases
    }

    /// Bytes that one pass over all blocks reads.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.held[..]) + size_of_val(&self.values[..])
    }

    /// The residuals of block `block` from row-major [C, B] `potentials`.
    #[inline(always)]
    pub(super) fn residuals<S: Simd>(
        &self,
        simd: S,
        potentials: &[f32],
        block: usize,
        out: &mut Residuals,
    ) {
        let held = &self.held[block];
        let per_plane = self.bases.div_ceil(ROWS);
        let per_block = ATTRIBUTES * per_plane;
        let values = &self.values[block * per_block..(block + 1) * per_block];
        *out = [[0.0; BLOCK]; ATTRIBUTES];
        for (part, start) in (0..self.bases).step_by(BLOCK).enumerate() {
            let (forces, more) = self.forces(simd, potentials, held, start);
            for (out, rows) in out.iter_mut().zip(values.chunks_exact(per_plane)) {
                let mut sum = f32x16::load_array_ref(simd, out);
                if let Some(rows) = rows.get(2 * part) {
                    sum = weighed(simd, rows, &forces, sum);
                }
                if let Some(rows) = rows.get(2 * part + 1) {
                    sum = weighed(simd, rows, &more, sum);
                }
                sum.store_array(out);
            }
        }
        for (out, scales) in out.iter_mut().zip(&held.scales) {
            let scaled = f32x16::load_array_ref(simd, out) * f32x16::load_array_ref(simd, scales);
            scaled.store_array(out);
        }
    }

    /// Forces `start..start + 16` of a block's Gaussians: one vector a force, in two halves.
    #[inline(always)]
    fn forces<S: Simd>(
        &self,
        simd: S,
        potentials: &[f32],
        held: &Held,
        start: usize,
    ) -> ([f32x16<S>; ROWS], [f32x16<S>; ROWS]) {
        let mut forces = [f32x16::splat(simd, 0.0); BLOCK];
        for ((force, neighbours), masses) in
            forces.iter_mut().zip(&held.neighbours).zip(&held.masses)
        {
            let ([i, j, k], [a, b, c]) = (*neighbours, *masses);
            let first = self.row(simd, potentials, i, start) * a;
            let second = self.row(simd, potentials, j, start);
            let third = self.row(simd, potentials, k, start);
            let sum = second.mul_add(f32x16::splat(simd, b), first);
            *force = third.mul_add(f32x16::splat(simd, c), sum);
        }
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = transposed(forces);
        ([a, b, c, d, e, f, g, h], [i, j, k, l, m, n, o, p])
    }

    /// Potentials `start..start + 16` of a controller. Past the row's end lies the next row, whose numbers are multiplied by
    /// zero bases; past the last row there is nothing.
    #[inline(always)]
    fn row<S: Simd>(
        &self,
        simd: S,
        potentials: &[f32],
        controller: u16,
        start: usize,
    ) -> f32x16<S> {
        let at = usize::from(controller) * self.bases + start;
        if let Some(row) = potentials.get(at..at + BLOCK) {
            return f32x16::from_slice(simd, row);
        }
        let mut row = [0.0; BLOCK];
        let rest = potentials.get(at..).unwrap_or_default();
        row[..rest.len()].copy_from_slice(rest);
        f32x16::load_array(simd, row)
    }
}

/// `sum` and eight bases by eight forces. A fixed number, so that the loop is laid out and every sum stays in a register.
#[inline(always)]
fn weighed<S: Simd>(simd: S, rows: &Rows, forces: &[f32x16<S>; ROWS], sum: f32x16<S>) -> f32x16<S> {
    // Two sums that need not wait for one another.
    let (mut even, mut odd) = (sum, f32x16::splat(simd, 0.0));
    for k in 0..ROWS / 2 {
        even = widened(simd, &rows[2 * k]).mul_add(forces[2 * k], even);
        odd = widened(simd, &rows[2 * k + 1]).mul_add(forces[2 * k + 1], odd);
    }
    even + odd
}

#[inline(always)]
fn widened<S: Simd>(simd: S, values: &[i8; BLOCK]) -> f32x16<S> {
    let mut wide = [0.0; BLOCK];
    for lane in 0..BLOCK {
        wide[lane] = f32::from(values[lane]);
    }
    f32x16::load_array(simd, wide)
}

/// Transposes: four perfect shuffles of the rows laid end to end.
#[inline(always)]
fn transposed<S: Simd>(mut rows: [f32x16<S>; BLOCK]) -> [f32x16<S>; BLOCK] {
    for _ in 0..BLOCK.ilog2() {
        let before = rows;
        for k in 0..BLOCK / 2 {
            (rows[2 * k], rows[2 * k + 1]) = before[k].interleave(before[k + BLOCK / 2]);
        }
    }
    rows
}

impl Held {
    /// The Gaussians from `start` on; those past the last are nothing.
    fn new(bases: &QuantisedBases, controllers: &Controllers, start: usize) -> Self {
        let count = bases.gaussians();
        let (masses, neighbours) = (controllers.masses(), controllers.neighbours());
        Self {
            scales: std::array::from_fn(|plane| {
                std::array::from_fn(|lane| {
                    let relative = bases.scales()[plane * count..][..count].get(start + lane);
                    relative.map_or(0.0, |scale| scale.to_f32() * bases.units()[plane])
                })
            }),
            masses: std::array::from_fn(|lane| {
                masses.get(start + lane).copied().unwrap_or_default()
            }),
            neighbours: std::array::from_fn(|lane| {
                neighbours.get(start + lane).copied().unwrap_or_default()
            }),
        }
    }
}
