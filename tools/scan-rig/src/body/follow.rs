//! Eyeballs, teeth and tongue go where the face around them went when the skin was displaced.

use super::alignment::Alignment;
use super::model::{BodyModel, BodyPart};
use glam::DVec3;
use spmm3::Joint;

/// How far from an eye's centre its lids are, metres, in the model's rest pose.
const LIDS: f64 = 0.030;

/// How far from the mouth's middle the lips are, metres.
const LIPS: f64 = 0.045;

/// How much smaller or larger than the posed model an eyeball or a set of teeth may become.
const SIZES: (f64, f64) = (0.85, 1.2);

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
        Alignment::between(&near, SIZES)
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
