//! The similarity transform that lays one set of points on another (Umeyama 1991; Kabsch 1976 for its rotation), in f64.

use glam::{DMat3, DQuat, DVec3};
use nalgebra::Matrix3;

/// Iterations after which the singular values are given up; three by three needs about ten.
const MOST_ITERATIONS: usize = 100;
/// Share of the largest singular value that the second must have: below, the points lie on a line, which can turn about itself.
const LEAST_SPREAD: f64 = 1e-6;

/// One point in both spaces, and how much it counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Where it is before.
    pub from: DVec3,
    /// Where it should come to lie.
    pub to: DVec3,
    /// Weight of its squared distance, at least 0.
    pub weight: f64,
}

/// `to = to_centre + scale * to_from * (from - from_centre)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Rotation.
    pub to_from: DQuat,
    /// Length in `to` of one unit of `from`.
    pub scale: f64,
    /// The weighted middle of `from`.
    pub from_centre: DVec3,
    /// The weighted middle of `to`.
    pub to_centre: DVec3,
}

impl Similarity {
    /// The best similarity for `pairs`; nothing where they do not determine a rotation or hold numbers that are not finite.
    #[must_use]
    pub fn fit(pairs: &[Pair]) -> Option<Self> {
        let total: f64 = pairs.iter().map(|p| p.weight).sum();
        if !(total.is_finite() && total > 0.0) {
            return None;
        }
        let middle =
            |of: fn(&Pair) -> DVec3| pairs.iter().map(|p| of(p) * p.weight).sum::<DVec3>() / total;
        let from_centre = middle(|p| p.from);
        let to_centre = middle(|p| p.to);
        let mut covariance = DMat3::ZERO;
        let mut spread = 0.0;
        for pair in pairs {
            let (from, to) = (pair.from - from_centre, pair.to - to_centre);
            covariance += DMat3::from_cols(to * from.x, to * from.y, to * from.z) * pair.weight;
            spread += pair.weight * from.length_squared();
        }
        let values = covariance.to_cols_array();
        if values.iter().any(|v| !v.is_finite()) || !spread.is_finite() {
            return None;
        }
        let matrix = Matrix3::from_column_slice(&values);
        let svd = matrix.try_svd(true, true, f64::EPSILON, MOST_ITERATIONS)?;
        let (u, v_t) = (svd.u?, svd.v_t?);
        // nalgebra sorts them, the largest first.
        let [first, second, third] = [0, 1, 2].map(|k| svd.singular_values[k]);
        let determined = second > LEAST_SPREAD * first && first > f64::MIN_POSITIVE;
        if !determined || spread <= 0.0 {
            return None;
        }
        let sign = (u * v_t).determinant().signum();
        let flip = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign));
        let rotation = u * flip * v_t;
        let columns: [f64; 9] = rotation.as_slice().try_into().ok()?;
        let to_from = DQuat::from_mat3(&DMat3::from_cols_array(&columns)).normalize();
        let scale = (first + second + sign * third) / spread;
        (to_from.is_finite() && scale.is_finite() && scale > 0.0).then_some(Self {
            to_from,
            scale,
            from_centre,
            to_centre,
        })
    }

    /// `point` of `from` laid on `to`.
    #[must_use]
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.to_centre + self.to_from * (point - self.from_centre) * self.scale
    }

    /// `point` of `to` taken back to `from`.
    #[must_use]
    pub fn invert(&self, point: DVec3) -> DVec3 {
        self.from_centre + self.to_from.inverse() * (point - self.to_centre) / self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_similarity_is_found_and_inverted() {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.9, 0.8));
        let pairs: Vec<Pair> = (0..7)
            .map(|k| {
                let t = f64::from(k);
                let from = DVec3::new(t.sin(), (1.7 * t).cos(), 0.3 * t);
                Pair {
                    from,
                    to: turn * from * 250.0 + DVec3::new(3.0, -700.0, 12.0),
                    weight: 1.0 + t,
                }
            })
            .collect();
        let found = Similarity::fit(&pairs).expect("determined");
        assert!(found.to_from.angle_between(turn) < 1e-7, "the rotation");
        assert!((found.scale - 250.0).abs() < 1e-9, "the scale");
        for pair in &pairs {
            let there = found.apply(pair.from);
            assert!(there.distance(pair.to) < 1e-6, "{there} for {}", pair.to);
            let back = found.invert(pair.to);
            assert!(back.distance(pair.from) < 1e-9, "{back} for {}", pair.from);
        }
    }

    #[test]
    fn points_on_a_line_or_without_extent_determine_nothing() {
        let pair = |p: DVec3| Pair {
            from: p,
            to: p,
            weight: 1.0,
        };
        let line: Vec<_> = (0..5).map(|k| pair(DVec3::X * f64::from(k))).collect();
        assert_eq!(Similarity::fit(&line), None, "a line");
        assert_eq!(Similarity::fit(&[pair(DVec3::ONE); 5]), None, "a point");
        assert_eq!(Similarity::fit(&[pair(DVec3::NAN); 5]), None, "no numbers");
        assert_eq!(Similarity::fit(&[]), None, "nothing at all");
    }
}
