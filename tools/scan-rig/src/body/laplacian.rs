//! The smoothest displacement of a mesh's vertices that goes where some of them are pulled: conjugate gradients on the normal equations of the
//! mesh's Laplacian.

use super::model::Neighbours;
use crate::conjugate_gradients::{self, Enough};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// What keeps vertices at their place that nothing pulls.
const STAY: f64 = 0.002;

/// When a displacement is near enough.
const ENOUGH: Enough = Enough {
    left: 1e-4,
    steps: 2000,
};

/// What pulls a vertex.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pulled {
    /// A unit direction.
    pub normal: DVec3,
    /// The weight of being right along [`Self::normal`].
    pub along: f64,
    /// The weight of being right in every direction.
    pub every_way: f64,
    /// Weights times wanted displacements, metres.
    pub towards: DVec3,
}

/// The uniform Laplacian of a mesh: a vertex minus the mean of its neighbours.
#[derive(Debug)]
pub struct Laplacian<'a> {
    neighbours: &'a Neighbours,
    /// How much each vertex' Laplacian counts.
    stiffness: Vec<f64>,
    /// One over the number of neighbours.
    share: Vec<f64>,
}

impl<'a> Laplacian<'a> {
    /// Over the first vertices of the mesh, as many as `stiffness` has values; they must have no neighbours beyond.
    #[must_use]
    pub fn new(neighbours: &'a Neighbours, stiffness: Vec<f64>) -> Self {
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
    pub fn solve(&self, stiff: f64, pulled: &[Pulled], displacement: &mut [DVec3]) -> usize {
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
        let right: Vec<DVec3> = pulled.iter().map(|p| p.towards).collect();
        let mut scratch = vec![DVec3::ZERO; pulled.len()];
        conjugate_gradients::solve(
            &right,
            displacement,
            |x, product| self.apply(stiff, pulled, x, &mut scratch, product),
            |v, value| inverse[v] * value,
            ENOUGH,
        )
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
