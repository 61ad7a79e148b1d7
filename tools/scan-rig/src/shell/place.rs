//! What is in the head (eyeballs, teeth, tongue) put where the registered skin around it says, and kept behind it.

use crate::body::{BodyModel, Registered};
use glam::{DMat3, DVec3};
use spmm3::Joint;

/// How far the skin around may scale what is inside, relative to the body's scale.
const SCALE: (f64, f64) = (0.88, 1.12);

/// A similarity transform from the model's rest pose to the scan's pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    rotation: DMat3,
    scale: f64,
    translation: DVec3,
}

impl Placement {
    /// The placement that brings the skin around `centre` (rest pose, within `radius`) best to where it was registered. `shaped` are the
    /// registered shape's vertices in the rest pose. Nothing if there is no skin.
    pub(crate) fn around(
        model: &BodyModel,
        registered: &Registered,
        shaped: &[DVec3],
        centre: DVec3,
        radius: f64,
        take: impl Fn(usize) -> bool,
    ) -> Option<Self> {
        let rotation = registered.rotations[Joint::Head.index()];
        let pairs: Vec<(DVec3, DVec3)> = (0..model.body_vertices)
            .filter(|v| model.outer[*v] && shaped[*v].distance(centre) < radius && take(*v))
            .map(|v| (rotation * shaped[v], registered.vertices[v]))
            .collect();
        if pairs.len() < 8 {
            return None;
        }
        let count = pairs.len() as f64;
        let from = pairs.iter().map(|(a, _)| *a).sum::<DVec3>() / count;
        let to = pairs.iter().map(|(_, b)| *b).sum::<DVec3>() / count;
        let (mut above, mut below) = (0.0, 0.0);
        for (a, b) in &pairs {
            above += (*a - from).dot(*b - to);
            below += (*a - from).length_squared();
        }
        let own = registered.scale;
        let scale = if below > 0.0 { above / below } else { own };
        let scale = scale.clamp(SCALE.0 * own, SCALE.1 * own);
        (to.is_finite() && scale.is_finite()).then(|| Self {
            rotation,
            scale,
            translation: to - scale * from,
        })
    }

    /// A point of the rest pose in the scan's pose.
    #[must_use]
    pub(crate) fn point(&self, rest: DVec3) -> DVec3 {
        self.scale * (self.rotation * rest) + self.translation
    }
}

/// Triangles that rays are cast on.
#[derive(Debug, Default)]
pub(crate) struct Screen {
    triangles: Vec<[DVec3; 3]>,
}

impl Screen {
    /// The faces of the model's own skin, seen from outside, that have a corner within `radius` of `centre` (metres, the scan's pose).
    #[must_use]
    pub(crate) fn new(model: &BodyModel, vertices: &[DVec3], centre: DVec3, radius: f64) -> Self {
        let triangles = model.faces.iter().filter(|face| {
            face.iter().all(|v| (*v as usize) < model.body_vertices)
                && face.iter().any(|v| model.outer[*v as usize])
                && face.iter().any(|v| vertices[*v as usize].distance(centre) < radius)
        });
        Self {
            triangles: triangles.map(|face| face.map(|v| vertices[v as usize])).collect(),
        }
    }

    /// How far along `direction` the line through `origin` meets the screen, metres: the crossing with the least distance, which is
    /// negative behind the origin (Moeller and Trumbore 1997).
    #[must_use]
    pub(crate) fn nearest(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let crossing = |[a, b, c]: &[DVec3; 3]| {
            let (ab, ac) = (*b - *a, *c - *a);
            let p = direction.cross(ac);
            let determinant = ab.dot(p);
            if determinant.abs() < 1e-14 {
                return None;
            }
            let s = origin - *a;
            let u = s.dot(p) / determinant;
            let q = s.cross(ab);
            let v = direction.dot(q) / determinant;
            (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| ac.dot(q) / determinant)
        };
        (self.triangles.iter())
            .filter_map(crossing)
            .min_by(|a, b| a.abs().total_cmp(&b.abs()))
    }
}
