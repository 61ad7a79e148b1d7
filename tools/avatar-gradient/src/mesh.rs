//! F_mesh (paper, section IV-A): P -> canonical vertices.

use crate::layer;
use crate::parameters::Parameters;
use crate::planes::{RUN, add_scaled, dot};
use fearless_simd::{Level, dispatch};
use rayon::prelude::*;

/// What F_mesh computed on the way.
#[derive(Debug, Clone, Default)]
pub(crate) struct MeshPass {
    /// What SiLU was given, and what it gave, after the first and the second layer.
    before: [Vec<f32>; 2],
    after: [Vec<f32>; 2],
    /// How much of each field the pose has, `[rank]`.
    code: Vec<f32>,
    by_code: Vec<f32>,
    by_after: Vec<f32>,
    by_before: Vec<f32>,
}

impl MeshPass {
    /// Whether the last forward pass was with the network (`on`) and of this rank.
    pub(crate) fn fits(&self, on: bool, rank: usize) -> bool {
        self.code.len() == if on { rank } else { 0 }
    }

    /// Canonical vertices ([3, N_v], metres) of P; `rest` are the template's. Without the network (`on`), the template and the mean
    /// offsets are left.
    pub(crate) fn forward(
        &mut self,
        level: Level,
        parameters: &Parameters,
        p: &[f32],
        rest: &[f32],
        on: bool,
        canonical: &mut Vec<f32>,
    ) {
        self.code.clear();
        if on {
            let [before_first, before_second] = &mut self.before;
            let [after_first, after_second] = &mut self.after;
            layer::forward(level, &parameters.mesh_first, p, before_first);
            layer::silu(before_first, after_first);
            layer::forward(level, &parameters.mesh_second, after_first, before_second);
            layer::silu(before_second, after_second);
            layer::forward(level, &parameters.mesh_code, after_second, &mut self.code);
        }
        canonical.resize(rest.len(), 0.0);
        let (code, columns) = (&self.code, rest.len());
        let runs = canonical.par_chunks_mut(RUN).enumerate();
        runs.for_each(|(run, out)| {
            dispatch!(level, simd => {
                let _ = simd;
                let range = run * RUN..run * RUN + out.len();
                let mean = &parameters.mesh_mean[range.clone()];
                for ((out, rest), mean) in out.iter_mut().zip(&rest[range.clone()]).zip(mean) {
                    *out = rest + mean;
                }
                let fields = parameters.mesh_fields.chunks_exact(columns);
                for (field, code) in fields.zip(code) {
                    add_scaled(out, &field[range.clone()], *code);
                }
            });
        });
    }

    /// Adds the derivatives by F_mesh's numbers, of those by the canonical vertices, to `gradients`, and those by P to `by_p`.
    pub(crate) fn backward(
        &mut self,
        level: Level,
        parameters: &Parameters,
        p: &[f32],
        by_canonical: &[f32],
        gradients: &mut Parameters,
        by_p: &mut [f32],
    ) {
        add_scaled(&mut gradients.mesh_mean, by_canonical, 1.0);
        if self.code.is_empty() {
            return;
        }
        self.by_code.resize(self.code.len(), 0.0);
        let columns = by_canonical.len().max(1);
        let fields = parameters.mesh_fields.par_chunks_exact(columns);
        let by_fields = gradients.mesh_fields.par_chunks_exact_mut(columns);
        let codes = self.code.par_iter().zip(self.by_code.par_iter_mut());
        fields
            .zip(by_fields)
            .zip(codes)
            .for_each(|((field, by_field), (code, by_code))| {
                dispatch!(level, simd => {
                    let _ = simd;
                    *by_code = dot(field, by_canonical);
                    add_scaled(by_field, by_canonical, *code);
                });
            });
        let [before_first, before_second] = &self.before;
        let [after_first, after_second] = &self.after;
        let (by_after, by_before) = (&mut self.by_after, &mut self.by_before);
        layer::backward(
            level,
            &parameters.mesh_code,
            after_second,
            &self.by_code,
            &mut gradients.mesh_code,
            by_before,
        );
        layer::silu_backward(before_second, by_before);
        layer::backward(
            level,
            &parameters.mesh_second,
            after_first,
            by_before,
            &mut gradients.mesh_second,
            by_after,
        );
        layer::silu_backward(before_first, by_after);
        layer::backward(
            level,
            &parameters.mesh_first,
            p,
            by_after,
            &mut gradients.mesh_first,
            by_before,
        );
        add_scaled(by_p, by_before, 1.0);
    }
}
