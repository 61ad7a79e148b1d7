//! What is in the head (eyeballs, teeth, tongue) put where the registered skin around it says, and kept behind it.

use super::harmonic::Edges;
use super::normals::normals;
use crate::body::{BodyModel, Registered};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use spmm3::Joint;

/// How far the skin around may scale what is inside, relative to the body's scale.
const SCALE: (f64, f64) = (0.94, 1.05);

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

/// How far what is under the skin of the face stays under it, metres.
const UNDER: f64 = 0.002;

/// Puts what the scan cannot show of the head's skin (the mouth's inside, sockets, folded lids) where the shown skin around it says: as the
/// model has it, with the displacement of the shown skin continued; and what does not turn outwards with closed lids (`is_deep`) under
/// the skin. `vertices` are the model's in the scan's pose.
pub(crate) fn settle(
    model: &BodyModel,
    registered: &Registered,
    (shaped, joints): (&[DVec3], &[DVec3]),
    vertices: &mut [DVec3],
    is_deep: impl Fn(usize) -> bool + Sync,
) {
    let head = Joint::Head.index();
    let Some(pivot) = joints.get(head) else {
        return;
    };
    let place = |rest: DVec3| {
        registered.joints[head] + registered.scale * (registered.rotations[head] * (rest - *pivot))
    };
    let reach = 0.2;
    let near: Vec<bool> = (0..vertices.len())
        .map(|v| {
            v < model.body_vertices
                && shaped[v].distance(*pivot) < reach
                && model.head_share(v) > 0.5
        })
        .collect();
    let known: Vec<bool> = (0..vertices.len())
        .map(|v| near[v] && model.outer[v])
        .collect();
    let displaced: Vec<DVec3> = (0..vertices.len())
        .map(|v| {
            if near[v] {
                vertices[v] - place(shaped[v])
            } else {
                DVec3::ZERO
            }
        })
        .collect();
    let faces = (model.faces.iter().copied()).filter(|face| face.iter().all(|v| near[*v as usize]));
    let filled = Edges::new(shaped, faces).fill(&displaced, &known);
    let hidden: Vec<usize> = (0..vertices.len())
        .filter(|v| near[*v] && !model.outer[*v])
        .collect();
    for v in &hidden {
        vertices[*v] = place(shaped[*v]) + filled[*v];
    }
    let outside: Vec<usize> = (0..vertices.len()).filter(|v| known[*v]).collect();
    let own = |face: usize| {
        model.faces[face]
            .iter()
            .all(|v| near[*v as usize] && model.outer[*v as usize])
    };
    let normals = normals(vertices, &model.faces, own);
    let pushed: Vec<(usize, DVec3)> = hidden
        .par_iter()
        .filter(|v| is_deep(**v))
        .filter_map(|v| {
            let here = vertices[*v];
            let nearest = outside.iter().min_by(|a, b| {
                vertices[**a]
                    .distance_squared(here)
                    .total_cmp(&vertices[**b].distance_squared(here))
            })?;
            let away = here - vertices[*nearest];
            // At the rims the skin turns in, and may not be torn.
            let under = f64::min(UNDER * registered.scale, 0.5 * away.length());
            let height = away.dot(normals[*nearest]) + under;
            (height > 0.0).then(|| (*v, here - height * normals[*nearest]))
        })
        .collect();
    for (v, place) in pushed {
        vertices[v] = place;
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
                && face
                    .iter()
                    .any(|v| vertices[*v as usize].distance(centre) < radius)
        });
        Self::of(triangles.map(|face| face.map(|v| vertices[v as usize])))
    }

    /// Of these triangles.
    #[must_use]
    pub(crate) fn of(triangles: impl Iterator<Item = [DVec3; 3]>) -> Self {
        Self {
            triangles: triangles.collect(),
        }
    }

    /// How far along `direction` the ray from `origin` first meets the screen, metres.
    #[must_use]
    pub(crate) fn first(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        (self.crossings(origin, direction))
            .filter(|height| *height > 0.0)
            .min_by(f64::total_cmp)
    }

    /// How far along `direction` the line through `origin` meets the screen, metres: the crossing with the least distance, which is
    /// negative behind the origin.
    #[must_use]
    pub(crate) fn nearest(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        (self.crossings(origin, direction)).min_by(|a, b| a.abs().total_cmp(&b.abs()))
    }

    /// Where a line meets the triangles (Moeller and Trumbore 1997).
    fn crossings(&self, origin: DVec3, direction: DVec3) -> impl Iterator<Item = f64> {
        let crossing = move |[a, b, c]: &[DVec3; 3]| {
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
        self.triangles.iter().filter_map(crossing)
    }
}
