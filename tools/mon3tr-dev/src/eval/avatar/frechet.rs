//! The Frechet inception distance (Heusel et al., "GANs Trained by a Two Time-Scale Update Rule", 2017): how far apart the distributions of two
//! sets of pictures are, each taken for a normal one over a network's features.

use nalgebra::DMatrix;

/// |m_a - m_b|^2 + Tr(C_a + C_b - 2 (C_a C_b)^(1/2)) of features, a row a picture; nothing for fewer than two pictures a set, or features
/// of different lengths.
///
/// Features are many and pictures few, so no covariance is formed: with centred rows A and B, the eigenvalues of C_a C_b other than 0 are the
/// squares of the singular values of A B^T / sqrt((n_a - 1) (n_b - 1)), whose sum is the trace of the root.
pub(super) fn distance(a: &[Vec<f32>], b: &[Vec<f32>]) -> Option<f64> {
    let length = a.first()?.len();
    let same = a.iter().chain(b).all(|features| features.len() == length);
    if a.len() < 2 || b.len() < 2 || !same || length == 0 {
        return None;
    }
    let ((mean_a, a), (mean_b, b)) = (centred(a), centred(b));
    let between: f64 = (mean_a.iter().zip(&mean_b))
        .map(|(a, b)| (a - b) * (a - b))
        .sum();
    let (scale_a, scale_b) = (1.0 / (a.nrows() - 1) as f64, 1.0 / (b.nrows() - 1) as f64);
    let traces = a.norm_squared() * scale_a + b.norm_squared() * scale_b;
    let product = &a * b.transpose() * (scale_a * scale_b).sqrt();
    let root: f64 = product.singular_values().iter().sum();
    Some(between + traces - 2.0 * root)
}

/// The mean row, and the rows without it.
fn centred(rows: &[Vec<f32>]) -> (Vec<f64>, DMatrix<f64>) {
    let columns = rows[0].len();
    let mean: Vec<f64> = (0..columns)
        .map(|k| rows.iter().map(|row| f64::from(row[k])).sum::<f64>() / rows.len() as f64)
        .collect();
    let centred = DMatrix::from_fn(rows.len(), columns, |row, column| {
        f64::from(rows[row][column]) - mean[column]
    });
    (mean, centred)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn features(seed: u64, count: usize, shift: f32, scale: f32) -> Vec<Vec<f32>> {
        let mut rng = fastrand::Rng::with_seed(seed);
        (0..count)
            .map(|_| {
                (0..5u8)
                    .map(|k| shift + scale * (f32::from(k) + 1.0) * rng.f32())
                    .collect()
            })
            .collect()
    }

    /// With covariances, and the root of sqrt(C_a) C_b sqrt(C_a) by its eigenvalues.
    fn by_covariances(a: &[Vec<f32>], b: &[Vec<f32>]) -> f64 {
        let covariance = |rows: &[Vec<f32>]| {
            let (mean, centred) = centred(rows);
            (
                mean,
                centred.transpose() * &centred / (rows.len() - 1) as f64,
            )
        };
        let ((mean_a, ca), (mean_b, cb)) = (covariance(a), covariance(b));
        let eigen = ca.clone().symmetric_eigen();
        let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        let root =
            &eigen.eigenvectors * DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose();
        let inner = (&root * &cb * &root).symmetric_eigenvalues();
        let trace: f64 = inner.iter().map(|value| value.max(0.0).sqrt()).sum();
        let between: f64 = mean_a
            .iter()
            .zip(&mean_b)
            .map(|(a, b)| (a - b).powi(2))
            .sum();
        between + ca.trace() + cb.trace() - 2.0 * trace
    }

    #[test]
    fn it_is_that_of_the_covariances_and_0_between_equal_sets() {
        let (a, b) = (features(1, 40, 0.0, 1.0), features(2, 25, 0.3, 1.4));
        let (found, wanted) = (distance(&a, &b).expect("two sets"), by_covariances(&a, &b));
        assert!((found / wanted - 1.0).abs() < 1e-9, "{found}, not {wanted}");
        let none = distance(&a, &a).expect("two sets");
        assert!(none.abs() < 1e-9, "{none} between equal sets");
        assert!(distance(&a, &b[..1]).is_none(), "one picture is no set");
    }
}
