//! From the fitted model to the scan's surface: a displacement of each vertex, smooth over the mesh, that brings the seen vertices to the surface and the
//! face's landmarks to theirs.
//!
//! Sorkine et al., Laplacian Surface Editing (2004), in rounds: each matches the surface anew and is softer than the one before.

use super::fit::Fitted;
use super::laplacian::{Laplacian, Pulled};
use super::model::BodyModel;
use crate::nearest::{Nearest, oriented};
use crate::normals::vertex_normals;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use spmm3::Joint;

/// Each round's stiffness, and how far the surface may be, metres.
const ROUNDS: [(f64, f64); 5] = [
    (30.0, 0.050),
    (10.0, 0.040),
    (3.0, 0.030),
    (1.0, 0.030),
    (0.5, 0.025),
];

/// Metres that two opposite normals are worth, halved.
const NORMAL: f32 = 0.05;

/// How much stiffer the head is, and the front of it in addition: eyes, lips and nose keep their form.
const HEAD: f64 = 4.0;
const FACE: f64 = 8.0;

/// Fingers are matched badly: they hold things.
const FINGERS: f64 = 0.02;

/// A landmark's weight.
const LANDMARK: f64 = 4.0;

/// In a face only what is this near counts, metres, and only from this round on: before, lips would be matched with the nose.
const FACE_REACH: f64 = 0.008;
const FACE_ROUND: usize = 2;

/// What the last round found.
#[derive(Debug, Clone)]
pub(super) struct Displaced {
    /// `[body vertices]` metres.
    pub(super) vertices: Vec<DVec3>,
    /// Median distance of the matched vertices from the surface along their normals, metres.
    pub(super) residual: f64,
    /// `[body vertices]` how far the surface is from the fitted model along the normal, metres, where it was seen and the vertex is not closed in.
    pub(super) offsets: Vec<Option<f64>>,
}

/// Displaces the body's own vertices. `fitted`: the model as the fit put it; `surface`: points and unit outward normals; `landmarks`: vertices and where they
/// are, metres.
pub(super) fn displaced(
    model: &BodyModel,
    fitted: &Fitted,
    surface: &[(Vec3, Vec3)],
    landmarks: &[(usize, DVec3)],
) -> Displaced {
    let closed_in = fitted.closed_in.as_slice();
    let fitted = fitted.posed.vertices.as_slice();
    let count = model.body_vertices;
    let skull = model.joints[Joint::Head.index()].z;
    let face: Vec<f64> = (0..count)
        .map(|v| {
            let front = model.rest[v].z > skull;
            if front { model.head_share(v) } else { 0.0 }
        })
        .collect();
    let stiffness = (0..count)
        .map(|v| 1.0 + HEAD * model.head_share(v) + FACE * face[v])
        .collect();
    let laplacian = Laplacian::new(&model.neighbours, stiffness);
    let places: Vec<[f32; 6]> = (surface.iter())
        .map(|(point, normal)| oriented(*point, *normal, NORMAL))
        .collect();
    let tree = Nearest::new(&places);
    let base = &fitted[..count];
    let mut displacement = vec![DVec3::ZERO; count];
    let mut vertices = base.to_vec();
    let match_surface = |vertices: &[DVec3], round: usize, reach: f64| -> Vec<Option<(f64, f64)>> {
        // The faces of eyeballs and teeth name later vertices; the body's come first.
        let mut all = fitted.to_vec();
        all[..count].copy_from_slice(vertices);
        let normals = vertex_normals(&all, &model.faces, DVec3::ZERO);
        (0..count)
            .into_par_iter()
            .map(|v| {
                let normal = normals[v];
                let query = oriented(vertices[v].as_vec3(), normal.as_vec3(), NORMAL);
                let (point, outwards) = surface[tree.one(&query)?.at];
                let apart = point.as_dvec3() - vertices[v];
                let far = apart.length();
                let facing = normal.dot(outwards.as_dvec3());
                let in_face = face[v] > 0.3;
                let fits = far < reach
                    && !closed_in[v]
                    && facing > 0.5
                    && model.outer[v]
                    && (!in_face || (round >= FACE_ROUND && far < FACE_REACH));
                let hand = if model.finger_share(v) > 0.3 {
                    FINGERS
                } else {
                    1.0
                };
                fits.then(|| (hand / (1.0 + (far / 0.03).powi(2)), apart.dot(normal)))
            })
            .collect()
    };
    let first = match_surface(base, ROUNDS.len(), ROUNDS[0].1);
    let first = first
        .iter()
        .map(|found| found.map(|(_, distance)| distance))
        .collect();
    for (round, (stiff, reach)) in ROUNDS.into_iter().enumerate() {
        let mut all = fitted.to_vec();
        all[..count].copy_from_slice(&vertices);
        let normals = vertex_normals(&all, &model.faces, DVec3::ZERO);
        let found = match_surface(&vertices, round, reach);
        let mut pulled: Vec<Pulled> = (found.iter().enumerate())
            .map(|(v, found)| {
                let (weight, distance) = found.unwrap_or_default();
                Pulled {
                    normal: normals[v],
                    along: weight,
                    every_way: 0.0,
                    towards: normals[v] * (weight * (distance + normals[v].dot(displacement[v]))),
                }
            })
            .collect();
        for (vertex, place) in landmarks {
            if let Some(pulled) = pulled.get_mut(*vertex) {
                pulled.every_way += LANDMARK;
                pulled.towards += LANDMARK * (*place - base[*vertex]);
            }
        }
        let steps = laplacian.solve(4.0 * stiff, &pulled, &mut displacement);
        log::trace!("stiffness {stiff}: {steps} steps");
        for ((vertex, base), offset) in vertices.iter_mut().zip(base).zip(&displacement) {
            *vertex = *base + *offset;
        }
    }
    let last = match_surface(&vertices, ROUNDS.len(), ROUNDS[ROUNDS.len() - 1].1);
    let mut sizes: Vec<f64> = last.iter().flatten().map(|(_, d)| d.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    Displaced {
        residual: sizes.get(sizes.len() / 2).copied().unwrap_or_default(),
        vertices,
        offsets: first,
    }
}
