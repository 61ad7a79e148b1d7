//! F_attr's controllers (paper, section IV-B): P -> displacement potentials u_j = SiLU(P A_j + a_j) C_j + c_j.

use crate::layer;
use crate::parameters::Parameters;
use crate::planes::{add_scaled, dot};
use fearless_simd::{Level, dispatch};

/// What the controllers computed on the way.
#[derive(Debug, Clone, Default)]
pub(crate) struct ControllerPass {
    /// H and B.
    shape: [usize; 2],
    /// What SiLU was given and what it gave, [C, H].
    before: Vec<f32>,
    after: Vec<f32>,
    /// Row-major [C, B].
    pub(crate) potentials: Vec<f32>,
    by_after: Vec<f32>,
    by_p: Vec<f32>,
}

impl ControllerPass {
    /// Potentials of P; `hidden` units and `bases` potentials each.
    pub(crate) fn forward(
        &mut self,
        level: Level,
        parameters: &Parameters,
        p: &[f32],
        shape: [usize; 2],
    ) {
        self.shape = shape;
        let [hidden, bases] = shape;
        layer::forward(level, &parameters.controllers_first, p, &mut self.before);
        layer::silu(&self.before, &mut self.after);
        self.potentials.clear();
        self.potentials
            .extend_from_slice(&parameters.controllers_second_bias);
        let controllers = self.potentials.chunks_exact_mut(bases.max(1));
        let weights = parameters
            .controllers_second
            .chunks_exact((hidden * bases).max(1));
        let units = self.after.chunks_exact(hidden.max(1));
        dispatch!(level, simd => {
            let _ = simd;
            for ((potentials, weights), units) in controllers.zip(weights).zip(units) {
                for (row, unit) in weights.chunks_exact(bases).zip(units) {
                    add_scaled(potentials, row, *unit);
                }
            }
        });
    }

    /// Adds the derivatives by the controllers' numbers, of those by the potentials, to `gradients`, and those by P to `by_p`.
    pub(crate) fn backward(
        &mut self,
        level: Level,
        parameters: &Parameters,
        p: &[f32],
        by_potentials: &[f32],
        gradients: &mut Parameters,
        by_p: &mut [f32],
    ) {
        let [hidden, bases] = self.shape.map(|count| count.max(1));
        add_scaled(&mut gradients.controllers_second_bias, by_potentials, 1.0);
        self.by_after.resize(self.after.len(), 0.0);
        let weights = parameters.controllers_second.chunks_exact(hidden * bases);
        let by_weights = gradients
            .controllers_second
            .chunks_exact_mut(hidden * bases);
        let units = self.after.chunks_exact(hidden);
        let by_units = self.by_after.chunks_exact_mut(hidden);
        let by_potentials = by_potentials.chunks_exact(bases);
        dispatch!(level, simd => {
            let _ = simd;
            let layers = weights.zip(by_weights);
            let units = units.zip(by_units);
            for (((weights, by_weights), (units, by_units)), by) in layers.zip(units).zip(by_potentials) {
                let rows = weights.chunks_exact(bases).zip(by_weights.chunks_exact_mut(bases));
                for ((row, by_row), (unit, by_unit)) in rows.zip(units.iter().zip(by_units)) {
                    *by_unit = dot(row, by);
                    add_scaled(by_row, by, *unit);
                }
            }
        });
        layer::silu_backward(&self.before, &mut self.by_after);
        layer::backward(
            level,
            &parameters.controllers_first,
            p,
            &self.by_after,
            &mut gradients.controllers_first,
            &mut self.by_p,
        );
        add_scaled(by_p, &self.by_p, 1.0);
    }
}
