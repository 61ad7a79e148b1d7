//! Sums of squares of linear terms, and the step that makes them least.

use nalgebra::{Cholesky, DMatrix, DVector};

/// `H` and `g` of `H x = g`: the lower triangle of the sum of weighted products of the terms' rows, and the sum of rows times residuals.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    unknowns: usize,
    /// Row by row, of which only the part up to the diagonal is used.
    products: Vec<f64>,
    gradient: Vec<f64>,
}

impl NormalEquations {
    /// The sum of no terms.
    #[must_use]
    pub fn new(unknowns: usize) -> Self {
        Self {
            unknowns,
            products: vec![0.0; unknowns * unknowns],
            gradient: vec![0.0; unknowns],
        }
    }

    /// How many unknowns there are.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// An entry of `H`, which is symmetric.
    #[must_use]
    pub fn product(&self, row: usize, column: usize) -> f64 {
        self.products[row.max(column) * self.unknowns + row.min(column)]
    }

    /// `g`.
    #[must_use]
    pub fn gradient(&self) -> &[f64] {
        &self.gradient
    }

    /// Adds the term `weight * (row . x - residual)^2`.
    pub fn add(&mut self, row: &[f64], weight: f64, residual: f64) {
        for (at, value) in row.iter().enumerate() {
            let scaled = weight * value;
            if scaled != 0.0 {
                let line = &mut self.products[at * self.unknowns..][..=at];
                for (sum, other) in line.iter_mut().zip(row) {
                    *sum += scaled * other;
                }
                self.gradient[at] += scaled * residual;
            }
        }
    }

    /// Adds the term `weight * (x[at] - residual)^2`.
    pub fn add_one(&mut self, at: usize, weight: f64, residual: f64) {
        self.products[at * (self.unknowns + 1)] += weight;
        self.gradient[at] += weight * residual;
    }

    /// Adds another sum.
    pub fn merge(&mut self, other: &Self) {
        let sums = self.products.iter_mut().zip(&other.products);
        sums.for_each(|(sum, value)| *sum += value);
        let sums = self.gradient.iter_mut().zip(&other.gradient);
        sums.for_each(|(sum, value)| *sum += value);
    }

    /// The step, its diagonal damped by the share `damping`; nothing where the equations have no finite solution.
    #[must_use]
    pub fn solved(&self, damping: f64) -> Option<DVector<f64>> {
        let step = self
            .factor(damping)?
            .solve(&DVector::from_column_slice(&self.gradient));
        step.iter().all(|value| value.is_finite()).then_some(step)
    }

    /// The Cholesky factor of `H`, which is also that of the inverse of the unknowns' covariance.
    #[must_use]
    pub fn factor(&self, damping: f64) -> Option<Cholesky<f64, nalgebra::Dyn>> {
        let mut products = DMatrix::from_row_slice(self.unknowns, self.unknowns, &self.products);
        for at in 0..self.unknowns {
            products[(at, at)] *= 1.0 + damping;
        }
        products.fill_upper_triangle_with_lower_triangle();
        Cholesky::new(products)
    }
}
