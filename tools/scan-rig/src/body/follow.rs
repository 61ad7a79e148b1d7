//! Eyeballs, teeth and tongue go where the face around them went when the skin was displaced.

use super::model::{BodyModel, BodyPart};
use glam::{DMat3, DVec3};
use nalgebra::Matrix3;
use spmm3::Joint;

/// How far from an eye's centre its lids are, metres, in the model's rest pose.
const LIDS: f64 = 0.030;

/// How far from the mouth's middle the lips are, metres.
const LIPS: f64 = 0.045;

/// How much smaller or larger than the posed model an eyeball or a set of teeth may become.
const SIZES: (f64, f64) = (0.85, 1.2);

/// A uniformly scaled rigid motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Similarity {
    pub(super) scale: f64,
    pub(super) rotation: DMat3,
    pub(super) from: DVec3,
    pub(super) to: DVec3,
}

impl Similarity {
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
        let mut products = Matrix3::zeros();
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
        let sign = (u * v).determinant().signum();
        let mirror = Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign));
        let turn = u * mirror * v;
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

/// Moves the vertices after the body's own: `fitted` are all as the model was posed, `vertices` has the body's own displaced.
pub(super) fn follow(model: &BodyModel, fitted: &[DVec3], vertices: &mut [DVec3]) {
    let mut part_of = vec![BodyPart::Skin; vertices.len()];
    for (face, part) in model.faces.iter().zip(&model.parts) {
        face.iter().for_each(|v| part_of[*v as usize] = *part);
    }
    let around = |middle: DVec3, reach: f64, vertices: &[DVec3]| {
        let near = (0..model.body_vertices)
            .filter(|v| model.outer[*v] && model.rest[*v].distance(middle) < reach)
            .map(|v| (fitted[v], vertices[v]))
            .collect::<Vec<_>>();
        Similarity::between(&near, SIZES)
    };
    let eyes = [Joint::LeftEye, Joint::RightEye].map(|eye| model.joints[eye.index()]);
    let [left, right] = eyes.map(|eye| around(eye, LIDS, vertices));
    let teeth = (model.body_vertices..vertices.len()).filter(|v| part_of[*v] == BodyPart::Teeth);
    // The foremost tooth is behind the lips' middle.
    let front = teeth
        .map(|v| model.rest[v])
        .max_by(|a, b| a.z.total_cmp(&b.z));
    let mouth = front.map(|front| around(front, LIPS, vertices));
    for v in model.body_vertices..vertices.len() {
        let motion = match part_of[v] {
            BodyPart::Eyes if model.rest[v].x > 0.0 => Some(left),
            BodyPart::Eyes => Some(right),
            _ => mouth,
        };
        if let Some(motion) = motion {
            vertices[v] = motion.apply(fitted[v]);
        }
    }
}
