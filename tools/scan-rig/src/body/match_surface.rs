//! Which vertex of the model each point of a surface belongs to, and how far it is off along the normal.

use super::derivatives::Derivatives;
use super::model::BodyModel;
use super::normal_equations::NormalEquations;
use super::state::Posed;
use crate::nearest::{Nearest, oriented};
use crate::normals::vertex_normals;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use spmm3::Joint;
use std::collections::BTreeMap;

/// Metres that two opposite normals are worth, halved.
const NORMAL: f32 = 0.08;

/// Hands hold things and are clenched: their share of the weight.
const HANDS: f64 = 0.15;

/// Vertices in a chunk of the sum: a fixed number, so that the sum does not depend on the machine.
const CHUNK: usize = 512;

/// What the points nearest to one vertex ask of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pull {
    pub(super) vertex: usize,
    pub(super) normal: DVec3,
    /// How much of the vertex is under clothes, 0..=1.
    pub(super) clothed: f64,
    /// Sum of the points' weights.
    pub(super) weight: f64,
    /// Sum of weights times distances from the clothed vertex along the normal, metres.
    pub(super) distance: f64,
    /// Sum of weights times squared distances.
    pub(super) squared: f64,
}

/// Matches points to the outside of the model; `reach`: points about this far off, metres, have a quarter of the weight, and those three times
/// as far have none. Points at vertices that are `[body vertices]` closed in have none either. Ascending by vertex.
pub(super) fn matched(
    model: &BodyModel,
    posed: &Posed,
    closed_in: &[bool],
    points: &[(Vec3, Vec3)],
    cloth: f64,
    reach: f64,
) -> Vec<Pull> {
    let normals = vertex_normals(&posed.vertices, &model.faces, DVec3::ZERO);
    let outside: Vec<usize> = (0..model.body_vertices)
        .filter(|v| model.outer[*v])
        .collect();
    let clothed: Vec<f64> = (0..model.body_vertices)
        .map(|v| model.clothed_share(v))
        .collect();
    let surface = |v: usize| posed.vertices[v] + normals[v] * (cloth * clothed[v]);
    let places: Vec<[f32; 6]> = (outside.iter())
        .map(|v| oriented(surface(*v).as_vec3(), normals[*v].as_vec3(), NORMAL))
        .collect();
    let tree = Nearest::new(&places);
    let found: Vec<Option<(usize, f64, f64)>> = points
        .par_iter()
        .map(|(point, normal)| {
            let vertex = outside[tree.one(&oriented(*point, *normal, NORMAL))?.at];
            let apart = point.as_dvec3() - surface(vertex);
            let far = apart.length();
            let facing = normals[vertex].dot(normal.as_dvec3());
            let fall = 1.0 + (far / reach).powi(2);
            let weight = model.hand_factor(vertex) / (fall * fall);
            (far < 3.0 * reach && facing > 0.3 && weight > 0.01 && !closed_in[vertex])
                .then(|| (vertex, weight, apart.dot(normals[vertex])))
        })
        .collect();
    let mut pulls: BTreeMap<usize, Pull> = BTreeMap::new();
    for (vertex, weight, distance) in found.into_iter().flatten() {
        let pull = pulls.entry(vertex).or_insert(Pull {
            vertex,
            normal: normals[vertex],
            clothed: clothed[vertex],
            weight: 0.0,
            distance: 0.0,
            squared: 0.0,
        });
        pull.weight += weight;
        pull.distance += weight * distance;
        pull.squared += weight * distance * distance;
    }
    pulls.into_values().collect()
}

/// Adds the terms of the pulls, `weight` times.
pub(super) fn add(
    pulls: &[Pull],
    weight: f64,
    derivatives: &Derivatives<'_>,
    cloth_at: usize,
    equations: &mut NormalEquations,
) {
    let unknowns = equations.unknowns();
    let sums: Vec<NormalEquations> = pulls
        .par_chunks(CHUNK)
        .map(|chunk| {
            let mut sum = NormalEquations::new(unknowns);
            let mut row = vec![0.0; unknowns];
            for pull in chunk {
                derivatives.of_vertex(pull.vertex, pull.normal, &mut row);
                row[cloth_at] = pull.clothed;
                sum.add(&row, weight * pull.weight, pull.distance / pull.weight);
            }
            sum
        })
        .collect();
    sums.iter().for_each(|sum| equations.merge(sum));
}

/// Weighted root mean square distance of the points from the model along its normals, metres; infinite if none was matched.
pub(super) fn residual(pulls: &[Pull]) -> f64 {
    let weight: f64 = pulls.iter().map(|pull| pull.weight).sum();
    let squared: f64 = pulls.iter().map(|pull| pull.squared).sum();
    if weight > 0.0 {
        (squared / weight).sqrt()
    } else {
        f64::INFINITY
    }
}

impl BodyModel {
    /// How much of a vertex is under clothes as a rule, 0..=1: not head, neck and hands.
    #[must_use]
    pub fn clothed_share(&self, vertex: usize) -> f64 {
        let bare = self.share(vertex, &[Joint::Neck, Joint::LeftWrist, Joint::RightWrist]);
        (1.0 - bare - self.head_share(vertex) - self.finger_share(vertex)).clamp(0.0, 1.0)
    }

    /// What a point at a vertex is worth: less at hands.
    #[must_use]
    pub fn hand_factor(&self, vertex: usize) -> f64 {
        let wrists = self.share(vertex, &[Joint::LeftWrist, Joint::RightWrist]);
        if self.finger_share(vertex) + 0.5 * wrists > 0.5 {
            HANDS
        } else {
            1.0
        }
    }
}
