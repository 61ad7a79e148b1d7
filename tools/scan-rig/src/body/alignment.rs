//! The scaled rigid motion that brings points onto others.

use glam::{DMat3, DVec3};
use nalgebra::Matrix3;

/// A uniformly scaled rigid motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Alignment {
    pub(super) scale: f64,
    pub(super) rotation: DMat3,
    pub(super) from: DVec3,
    pub(super) to: DVec3,
}

impl Alignment {
    /// The one that brings the points `from` nearest to `to`, in the sense of least squares (Umeyama 1991); its scale is held within `sizes`. At least
    /// three points, or only a translation.
    pub(super) fn between(pairs: &[(DVec3, DVec3)], sizes: (f64, f64)) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "fewer points than vertices")]
        let count = pairs.len().max(1) as f64;
        let from = pairs.iter().map(|(from, _)| *from).sum::<DVec3>() / count;
        let to = pairs.iter().map(|(_, to)| *to).sum::<DVec3>() / count;
        let mut still = Self {
            scale: 1.0,
            rotation: DMat3::IDENTITY,
            from,
            to,
        };
        if pairs.len() < 3 {
            return still;
        }
        let mut products = Matrix3::<f64>::zeros();
        let mut spread = 0.0;
        for (a, b) in pairs {
            let (a, b) = ((*a - from).to_array(), (*b - to).to_array());
            for (i, b) in b.iter().enumerate() {
                for (j, a) in a.iter().enumerate() {
                    products[(i, j)] += a * b;
                }
            }
            spread += a.iter().map(|a| a * a).sum::<f64>();
        }
        let svd = products.svd(true, true);
        let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
            return still;
        };
        let unmirrored: Matrix3<f64> = u * v;
        let sign = unmirrored.determinant().signum();
        let mirror = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign));
        let turn: Matrix3<f64> = u * mirror * v;
        let size: f64 = svd.singular_values.dot(&mirror.diagonal());
        if turn.iter().all(|value| value.is_finite()) && spread > 0.0 {
            still.rotation = DMat3::from_cols_slice(turn.as_slice());
            still.scale = (size / spread).clamp(sizes.0, sizes.1);
        }
        still
    }

    pub(super) fn apply(&self, point: DVec3) -> DVec3 {
        self.to + self.rotation * (point - self.from) * self.scale
    }
}
