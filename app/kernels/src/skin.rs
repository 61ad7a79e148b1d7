//! Linear blend skinning on the CPU, from at most four joints a vertex.
//!
//! For graphs that end at the canonical vertices ([`spmm3::networks::GraphParts::Networks`]). The ONNX graph multiplies
//! by a dense matrix of 55 joints, since no sparse form is faster there.

use super::{BLOCK, GRAIN, Sixteen, check_count};
use crate::KernelError;
use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use spmm3::{INFLUENCES, JOINTS, SkinningTransforms, Template};
use std::ops::Range;

/// A joint's 3x4 matrix, column after column, each with a fourth number that is 0.
type Columns = Sixteen;

/// Skinning weights of a template, and the joints' matrices of the frame being skinned.
#[derive(Debug, Clone)]
pub struct Skinner {
    /// Joints and weights of every vertex.
    weights: Vec<([u8; INFLUENCES], [f32; INFLUENCES])>,
    matrices: [Columns; JOINTS],
    level: Level,
}

impl Skinner {
    /// Takes the template's weights.
    #[must_use]
    pub fn new(template: &Template) -> Self {
        let weights = template.skin().iter();
        Self {
            weights: weights.map(|skin| (skin.joints, skin.weights)).collect(),
            matrices: [[0.0; BLOCK]; JOINTS],
            level: Level::new(),
        }
    }

    /// The same on another SIMD level.
    #[cfg(test)]
    pub(super) fn at_level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// Number of vertices N_v.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.weights.len()
    }

    /// Bytes of its own that skinning all vertices reads.
    #[must_use]
    pub fn table_bytes(&self) -> usize {
        size_of_val(&self.weights[..])
    }

    /// Skins `canonical` vertices (row-major [3, N_v], metres) into `posed`, of the same form; the root translation is
    /// left out, as in the graph. Runs on rayon's current pool and allocates nothing there.
    ///
    /// # Errors
    /// If `canonical` or `posed` are not of the template's size.
    pub fn skin(
        &mut self,
        canonical: &[f32],
        transforms: &SkinningTransforms,
        posed: &mut [f32],
    ) -> Result<(), KernelError> {
        let count = self.vertices();
        check_count("canonical vertex coordinates", canonical.len(), 3 * count)?;
        check_count("posed vertex coordinates", posed.len(), 3 * count)?;
        for (joint, matrix) in self.matrices.iter_mut().enumerate() {
            for row in 0..12 {
                matrix[row / 3 * 4 + row % 3] = transforms.0[row * JOINTS + joint];
            }
        }
        let (x, rest) = posed.split_at_mut(count);
        let (y, z) = rest.split_at_mut(count);
        self.in_halves(canonical, 0..count, [x, y, z]);
        Ok(())
    }

    fn in_halves(&self, canonical: &[f32], range: Range<usize>, posed: [&mut [f32]; 3]) {
        if range.len() <= GRAIN {
            dispatch!(self.level, simd => self.skin_run(simd, canonical, range, posed));
            return;
        }
        let half = (range.len() / 2).next_multiple_of(BLOCK);
        let middle = range.start + half;
        let [(x, x2), (y, y2), (z, z2)] = posed.map(|plane| plane.split_at_mut(half));
        rayon::join(
            || self.in_halves(canonical, range.start..middle, [x, y, z]),
            || self.in_halves(canonical, middle..range.end, [x2, y2, z2]),
        );
    }

    /// One thread's part.
    #[inline(always)]
    fn skin_run<S: Simd>(
        &self,
        simd: S,
        canonical: &[f32],
        range: Range<usize>,
        [out_x, out_y, out_z]: [&mut [f32]; 3],
    ) {
        let count = self.vertices();
        let [x, y, z] = [0, 1, 2].map(|axis| &canonical[axis * count..][range.clone()]);
        let outs = out_x.iter_mut().zip(out_y).zip(out_z);
        let ins = self.weights[range].iter().zip(x).zip(y).zip(z);
        for (((((joints, weights), x), y), z), ((out_x, out_y), out_z)) in ins.zip(outs) {
            let mut matrix = f32x16::splat(simd, 0.0);
            for (joint, weight) in joints.iter().zip(weights) {
                let columns = f32x16::load_array_ref(simd, &self.matrices[usize::from(*joint)]);
                matrix = columns.mul_add(f32x16::splat(simd, *weight), matrix);
            }
            let (low, high) = matrix.split();
            let ((c0, c1), (c2, c3)) = (low.split(), high.split());
            let sum = c0.mul_add(*x, c1.mul_add(*y, c2.mul_add(*z, c3)));
            [*out_x, *out_y, *out_z, _] = sum.to_array();
        }
    }
}
