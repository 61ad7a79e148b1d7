//! The smoothest displacement of a mesh's vertices that goes where some of them are pulled: conjugate gradients on the normal equations of the
//! mesh's Laplacian.

use super::model::Neighbours;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// What keeps vertices at their place that nothing pulls.
const STAY: f64 = 0.002;

/// Steps that are taken at most, and the share of the residual that is left when it is enough.
const STEPS: usize = 2000;
const LEFT: f64 = 1e-4;

/// What pulls a vertex.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pulled {
    /// A unit direction, and the weight of being right along it.
    pub(super) normal: DVec3,
    pub(super) along: f64,
    /// The weight of being right in every direction.
    pub(super) every_way: f64,
    /// Weights times wanted displacements, metres.
    pub(super) towards: DVec3,
}

/// The uniform Laplacian of a mesh: a vertex minus the mean of its neighbours.
pub(super) struct Laplacian<'a> {
    neighbours: &'a Neighbours,
    /// How much each vertex' Laplacian counts.
    stiffness: Vec<f64>,
    /// One over the number of neighbours.
    share: Vec<f64>,
}

impl<'a> Laplacian<'a> {
    /// Over the first vertices of the mesh, as many as `stiffness` has values; they must have no neighbours beyond.
    pub(super) fn new(neighbours: &'a Neighbours, stiffness: Vec<f64>) -> Self {
        let share = (0..stiffness.len())
            .map(|v| 1.0 / f64::max(1.0, f64::from(neighbours.count(v))))
            .collect();
        Self {
            neighbours,
            stiffness,
            share,
        }
    }

    /// Finds the displacement, which holds a first guess; returns the steps taken.
    pub(super) fn solve(&self, stiff: f64, pulled: &[Pulled], displacement: &mut [DVec3]) -> usize {
        let inverse: Vec<DMat3> = (0..pulled.len())
            .map(|v| {
                let around: f64 = (self.neighbours.of(v).iter())
                    .map(|n| self.stiffness[*n as usize] * self.share[*n as usize].powi(2))
                    .sum();
                let own = stiff * (self.stiffness[v] + around) + STAY + pulled[v].every_way;
                let Pulled { normal, along, .. } = pulled[v];
                let block = DMat3::from_diagonal(DVec3::splat(own))
                    + DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z)
                        * along;
                block.inverse()
            })
            .collect();
        let mut scratch = vec![DVec3::ZERO; pulled.len()];
        let mut product = scratch.clone();
        self.apply(stiff, pulled, displacement, &mut scratch, &mut product);
        let mut residual: Vec<DVec3> = (pulled.iter().zip(&product))
            .map(|(p, product)| p.towards - *product)
            .collect();
        let mut preconditioned: Vec<DVec3> = residual
            .iter()
            .zip(&inverse)
            .map(|(r, inverse)| *inverse * *r)
            .collect();
        let mut direction = preconditioned.clone();
        let mut size = dot(&residual, &preconditioned);
        let wanted: f64 = (pulled.iter().zip(&inverse))
            .map(|(p, inverse)| p.towards.dot(*inverse * p.towards))
            .sum();
        let enough = wanted * LEFT * LEFT;
        for step in 0..STEPS {
            if size <= enough {
                return step;
            }
            self.apply(stiff, pulled, &direction, &mut scratch, &mut product);
            let along = size / dot(&direction, &product).max(f64::MIN_POSITIVE);
            for (v, inverse) in inverse.iter().enumerate() {
                displacement[v] += along * direction[v];
                residual[v] -= along * product[v];
                preconditioned[v] = *inverse * residual[v];
            }
            let next = dot(&residual, &preconditioned);
            let turn = next / size;
            size = next;
            for (direction, preconditioned) in direction.iter_mut().zip(&preconditioned) {
                *direction = *preconditioned + turn * *direction;
            }
        }
        STEPS
    }

    /// The equations' left side.
    fn apply(
        &self,
        stiff: f64,
        pulled: &[Pulled],
        x: &[DVec3],
        scratch: &mut [DVec3],
        product: &mut [DVec3],
    ) {
        let chunk = 2048;
        (scratch.par_chunks_mut(chunk).enumerate()).for_each(|(at, scratch)| {
            for (v, scratch) in (at * chunk..).zip(scratch) {
                let around: DVec3 = self.neighbours.of(v).iter().map(|n| x[*n as usize]).sum();
                *scratch = (x[v] - self.share[v] * around) * (stiff * self.stiffness[v]);
            }
        });
        let scratch = &*scratch;
        (product.par_chunks_mut(chunk).enumerate()).for_each(|(at, product)| {
            for (v, product) in (at * chunk..).zip(product) {
                let around: DVec3 = (self.neighbours.of(v).iter())
                    .map(|n| scratch[*n as usize] * self.share[*n as usize])
                    .sum();
                let Pulled {
                    normal,
                    along,
                    every_way,
                    ..
                } = pulled[v];
                *product = scratch[v] - around
                    + x[v] * (STAY + every_way)
                    + normal * (along * normal.dot(x[v]));
            }
        });
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}
