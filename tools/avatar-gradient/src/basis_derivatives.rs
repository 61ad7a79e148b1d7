//! The derivatives by the deformation bases as factors: a Gaussian's forces times its derivatives by the attributes, and what L_guide pulls.

use crate::bases::Hold;
use crate::offsets::add_pulls;
use crate::planes::add_products;
use fearless_simd::{Level, dispatch};
use spmm3::{ATTRIBUTES, attribute};

/// Derivatives of one pose by all bases.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BasisDerivatives<'a> {
    pub(crate) level: Level,
    pub(crate) number_of_bases: usize,
    pub(crate) holds: &'a [Hold],
    /// [B, N_g].
    pub(crate) forces: &'a [f32],
    /// [14, N_g].
    pub(crate) by_local: &'a [f32],
    /// [C, B].
    pub(crate) potentials: &'a [f32],
    /// [3, 3, N_g], or empty.
    pub(crate) pulls: &'a [f32],
}

impl BasisDerivatives<'_> {
    /// Whether there are any, of so many bases.
    pub(crate) fn fit(&self, bases: usize) -> bool {
        let count = self.holds.len();
        self.by_local.len() == ATTRIBUTES * count
            && self.forces.len() == self.number_of_bases * count
            && bases == ATTRIBUTES * self.forces.len()
    }

    /// Whether a picture shows a Gaussian: it has a derivative by its opacity or colour.
    pub(crate) fn seen(&self, gaussian: usize) -> bool {
        let count = self.holds.len();
        (attribute::OPACITY..attribute::COLOUR.end)
            .any(|plane| self.by_local[plane * count + gaussian] != 0.0)
    }

    /// Adds the derivatives by row `row` of [14 x B, N_g], Gaussians `start..`, to `out`.
    pub(crate) fn add_to(&self, row: usize, start: usize, out: &mut [f32]) {
        let (plane, basis) = (row / self.number_of_bases, row % self.number_of_bases);
        let count = self.holds.len();
        let forces = &self.forces[basis * count + start..][..out.len()];
        let by_local = &self.by_local[plane * count + start..][..out.len()];
        dispatch!(self.level, simd => {
            let _ = simd;
            add_products(out, forces, by_local);
            if !self.pulls.is_empty() && attribute::OFFSET.contains(&plane) {
                let shape = [plane - attribute::OFFSET.start, basis, self.number_of_bases];
                add_pulls(self.holds, self.potentials, self.pulls, shape, start, out);
            }
        });
    }
}
