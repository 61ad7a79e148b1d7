//! The linear algebra of the fits: ridge regression, principal components, alignment of two codes.
//!
//! Samples are rows. Sums run in a fixed order whatever the number of threads, so that a seed gives one avatar.

use nalgebra::{DMatrix, DVector};

/// Weights W that minimise |features W - targets|^2 + lambda |W|^2; `lambda` is relative to the mean feature energy.
///
/// Columns listed in `free` (a constant column) are hardly penalised.
#[must_use]
pub fn ridge(
    features: &DMatrix<f64>,
    targets: &DMatrix<f64>,
    lambda: f64,
    free: Option<usize>,
) -> DMatrix<f64> {
    let transposed = features.transpose();
    solve_ridge(
        &transposed * features,
        &(&transposed * targets),
        lambda,
        free,
    )
}

/// The same from the normal equations' two sides: `square` = X^T X, `right` = X^T Y.
#[must_use]
pub fn solve_ridge(
    mut square: DMatrix<f64>,
    right: &DMatrix<f64>,
    lambda: f64,
    free: Option<usize>,
) -> DMatrix<f64> {
    let size = square.nrows();
    let energy = (square.trace() / size.max(1) as f64).max(1e-12);
    for k in 0..size {
        square[(k, k)] += energy
            * if free == Some(k) {
                1e-9
            } else {
                lambda.max(1e-9)
            };
    }
    match square.cholesky() {
        Some(cholesky) => cholesky.solve(right),
        // Not positive definite only if the features hold no information at all: then nothing is the best answer.
        None => DMatrix::zeros(size, right.ncols()),
    }
}

/// Principal components of samples around their mean.
#[derive(Debug, Clone)]
pub struct Components {
    /// Mean sample, `[columns]`.
    pub mean: Vec<f32>,
    /// Each sample's coordinates, `[samples, rank]`, of unit variance per component.
    pub codes: DMatrix<f64>,
    /// Each component's field, `[rank][columns]`, in the samples' unit at one deviation.
    pub fields: Vec<Vec<f32>>,
    /// Share of the variance that the kept components explain, 0..=1.
    pub explained: f64,
}

/// The first `rank` principal components of `samples` (all of one length), weighing columns by `weights`.
#[must_use]
pub fn components(samples: &[Vec<f32>], weights: &[f32], rank: usize) -> Components {
    let (count, columns) = (samples.len(), weights.len());
    let mut mean = vec![0.0f32; columns];
    for sample in samples {
        for (m, v) in mean.iter_mut().zip(sample) {
            *m += v / count.max(1) as f32;
        }
    }
    let centred: Vec<f32> = samples
        .iter()
        .flat_map(|s| {
            s.iter()
                .zip(&mean)
                .zip(weights)
                .map(|((v, m), w)| (v - m) * w)
        })
        .collect();
    // Column-major with samples as columns: the Gram matrix of samples is small, that of vertices is not.
    let centred = DMatrix::from_vec(columns, count, centred);
    let gram = (centred.transpose() * &centred).cast::<f64>();
    let total = gram.trace();
    let eigen = gram.symmetric_eigen();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    order.truncate(rank);
    let scale = (count.max(1) as f64).sqrt();
    let mut codes = DMatrix::zeros(count, rank);
    let mut fields = vec![vec![0.0f32; columns]; rank];
    let mut kept = 0.0;
    for (k, at) in order.into_iter().enumerate() {
        let value = eigen.eigenvalues[at];
        if value <= total * 1e-12 {
            continue;
        }
        kept += value;
        let vector: DVector<f64> = eigen.eigenvectors.column(at) * scale;
        codes.set_column(k, &vector);
        // Projecting the samples on a unit-variance code gives the field per deviation.
        for (sample, code) in samples.iter().zip(vector.iter()) {
            #[allow(clippy::cast_possible_truncation, reason = "f64 to f32 rounds")]
            let share = (code / (scale * scale)) as f32;
            for ((f, v), m) in fields[k].iter_mut().zip(sample).zip(&mean) {
                *f += share * (v - m);
            }
        }
    }
    Components {
        mean,
        codes,
        fields,
        explained: if total > 0.0 { kept / total } else { 1.0 },
    }
}

/// The leading left singular vectors of `data` times their singular values, `[samples, rank]`, by subspace iteration.
///
/// Cheaper than [`components`] where only the temporal code is wanted; `data` is `[samples, columns]`.
#[must_use]
pub fn temporal_codes(data: &DMatrix<f32>, rank: usize, rng: &mut fastrand::Rng) -> DMatrix<f64> {
    let rank = rank.min(data.nrows()).min(data.ncols());
    let wide = (rank + 5).min(data.nrows()).min(data.ncols());
    let transposed = data.transpose();
    let mut probe = DMatrix::from_fn(data.ncols(), wide, |_, _| rng.f32() - 0.5);
    let mut basis = DMatrix::zeros(data.nrows(), wide);
    for _ in 0..3 {
        basis = (data * &probe).qr().q();
        probe = &transposed * &basis;
    }
    // basis^T data has the singular values; its left vectors turn the basis into singular order.
    let small = probe.transpose().cast::<f64>();
    let gram = &small * small.transpose();
    let eigen = gram.symmetric_eigen();
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let basis = basis.cast::<f64>();
    let mut codes = DMatrix::zeros(data.nrows(), rank);
    for (k, at) in order.into_iter().take(rank).enumerate() {
        let value = eigen.eigenvalues[at].max(0.0).sqrt();
        let vector = &basis * eigen.eigenvectors.column(at) * value;
        codes.set_column(k, &vector);
    }
    codes
}

/// The rotation R (orthogonal, square) that brings `code` R closest to `reference` (orthogonal Procrustes, Schoenemann 1966).
#[must_use]
pub fn procrustes(code: &DMatrix<f64>, reference: &DMatrix<f64>) -> DMatrix<f64> {
    let size = code.ncols();
    let svd = (code.transpose() * reference).svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v)) => u * v,
        _ => DMatrix::identity(size, size),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
        let mut rng = fastrand::Rng::with_seed(seed);
        DMatrix::from_fn(rows, columns, |_, _| rng.f64() * 2.0 - 1.0)
    }

    #[test]
    fn ridge_is_where_gradient_descent_ends() {
        let (x, y) = (random(30, 4, 1), random(30, 2, 2));
        let lambda = 0.05;
        let w = ridge(&x, &y, lambda, None);
        let energy = (0..4).map(|k| x.column(k).norm_squared()).sum::<f64>() / 4.0;
        let mut slow = DMatrix::<f64>::zeros(4, 2);
        for _ in 0..20_000 {
            for i in 0..4 {
                for j in 0..2 {
                    let mut gradient = lambda * energy * slow[(i, j)];
                    for n in 0..30 {
                        let error: f64 =
                            (0..4).map(|k| x[(n, k)] * slow[(k, j)]).sum::<f64>() - y[(n, j)];
                        gradient += x[(n, i)] * error;
                    }
                    slow[(i, j)] -= 0.01 * gradient;
                }
            }
        }
        assert!((w - slow).abs().max() < 1e-6, "ridge and descent disagree");
    }

    #[test]
    fn components_rebuild_samples_of_their_rank_exactly() {
        let (codes, fields) = (random(12, 3, 3), random(3, 40, 4));
        let data = &codes * &fields;
        let narrow = data.cast::<f32>();
        let samples: Vec<Vec<f32>> = (0..12)
            .map(|n| narrow.row(n).iter().map(|v| v + 0.5).collect())
            .collect();
        let found = components(&samples, &[1.0; 40], 3);
        assert!(
            found.explained > 1.0 - 1e-6,
            "explained {}",
            found.explained
        );
        for (n, sample) in samples.iter().enumerate() {
            for (c, value) in sample.iter().enumerate() {
                let rebuilt = f64::from(found.mean[c])
                    + (0..3)
                        .map(|k| found.codes[(n, k)] * f64::from(found.fields[k][c]))
                        .sum::<f64>();
                assert!(
                    (rebuilt - f64::from(*value)).abs() < 1e-4,
                    "{rebuilt} for {value}"
                );
            }
        }
    }

    #[test]
    fn temporal_codes_span_what_the_full_decomposition_spans() {
        let data = (random(20, 3, 5) * random(3, 50, 6)).cast::<f32>();
        let codes = temporal_codes(&data, 3, &mut fastrand::Rng::with_seed(1));
        let exact = data.cast::<f64>().svd(true, false).singular_values;
        for k in 0..3 {
            assert!(
                (codes.column(k).norm() - exact[k]).abs() < 1e-3 * exact[0],
                "singular value {k}"
            );
        }
    }

    #[test]
    fn procrustes_undoes_a_rotation() {
        let code = random(25, 5, 7);
        let turn = random(5, 5, 8).qr().q();
        let found = procrustes(&(&code * turn.transpose()), &code);
        assert!(
            (found - turn).abs().max() < 1e-9,
            "the rotation was not found"
        );
    }
}
