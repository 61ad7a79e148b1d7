//! Skinning weights for garments that lack them, from the body, after Abdrashitov et al. 2023, "Robust Skin Weights
//! Transfer via Weight Inpainting": where a garment lies close on the body and faces as it does, it takes the weights of
//! the body's closest point; the rest is filled in smoothly along the garment's own surface. Unlike the paper, the fill is
//! harmonic (its Dirichlet term alone): such weights cannot leave 0..=1. It never changes weights a garment has.

use super::closest::{ClosestPoint, Found};
use super::pieces::connected;
use crate::makehuman::{BoneWeights, Quad};
use crate::shading::vertex_normals;
use glam::Vec3;
use std::collections::{BTreeMap, BTreeSet};

/// How far the body's closest point may be, over the diagonal of the garment's bounding box, as in the paper.
const REACH: f32 = 0.05;

/// How far the normals may differ, degrees, as in the paper.
const MAX_ANGLE: f32 = 30.0;

/// Bounds of the cotangents that weigh edges: positive, so that the fill stays between the values it starts from.
const COTANGENTS: (f64, f64) = (1e-2, 1e2);

/// Residual, over that at the start, at which a fill is done.
const TOLERANCE: f64 = 1e-7;

/// Weights by bone, as many as there are.
type Row = BTreeMap<u16, f64>;

/// The body as a source of weights, in the pose the garment was fitted in.
pub(super) struct Source<'a> {
    faces: Vec<[u32; 3]>,
    normals: Vec<Vec3>,
    weights: &'a [BoneWeights],
    closest: ClosestPoint,
}

impl<'a> Source<'a> {
    /// Takes the body's skin: faces that index `vertices` and `weights`.
    pub(super) fn new(vertices: &[Vec3], quads: &[Quad], weights: &'a [BoneWeights]) -> Self {
        let faces = triangles(quads);
        let corners = |face: &[u32; 3]| face.map(|v| vertices[v as usize]);
        Self {
            normals: vertex_normals(vertices, &faces),
            closest: ClosestPoint::new(faces.iter().map(corners).collect()),
            weights,
            faces,
        }
    }

    /// The weights at a point of the body.
    fn row(&self, found: &Found) -> Row {
        let mut row = Row::new();
        for (corner, share) in self.faces[found.triangle].iter().zip(found.shares) {
            for (bone, weight) in self.weights[*corner as usize] {
                if weight > 0.0 {
                    *row.entry(bone).or_default() += f64::from(share * weight);
                }
            }
        }
        row
    }

    fn normal(&self, found: &Found) -> Vec3 {
        let corners = self.faces[found.triangle].iter().zip(found.shares);
        corners
            .map(|(v, share)| self.normals[*v as usize] * share)
            .sum::<Vec3>()
            .normalize_or_zero()
    }

    /// The closest point's weights for each vertex that lies close enough and faces the same way.
    fn matches(&self, vertices: &[Vec3], faces: &[[u32; 3]]) -> Vec<Option<Row>> {
        let low = vertices.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = vertices.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let reach = REACH * low.distance(high);
        let least_cosine = MAX_ANGLE.to_radians().cos();
        vertices
            .iter()
            .zip(vertex_normals(vertices, faces))
            .map(|(vertex, normal)| {
                let found = self.closest.find(*vertex)?;
                let agrees = self.normal(&found).dot(normal) >= least_cosine;
                (agrees && found.distance <= reach).then(|| self.row(&found))
            })
            .collect()
    }

    /// Weights for every vertex of a garment: its `own` where it has them, else transferred. Rows sum to 1.
    ///
    /// A piece (a button) of which no vertex has or finds weights takes those of its closest points untested.
    ///
    /// # Errors
    /// Says which vertex ends without weights: the body has no faces, or the vertex lies infinitely far off.
    pub(super) fn transfer(
        &self,
        vertices: &[Vec3],
        quads: &[Quad],
        own: &[Option<BoneWeights>],
    ) -> Result<Vec<BoneWeights>, String> {
        let faces = triangles(quads);
        let mut rows = self.matches(vertices, &faces);
        for (row, own) in rows.iter_mut().zip(own) {
            if let Some(own) = own {
                let mut kept = Row::new();
                for (bone, weight) in own.iter().filter(|(_, weight)| *weight > 0.0) {
                    *kept.entry(*bone).or_default() += f64::from(*weight);
                }
                *row = Some(kept);
            }
        }
        let pieces = connected(vertices.len(), quads);
        let known = pieces.iter().zip(&rows).filter(|(_, row)| row.is_some());
        let anchored: BTreeSet<u32> = known.map(|(piece, _)| *piece).collect();
        for ((row, piece), vertex) in rows.iter_mut().zip(&pieces).zip(vertices) {
            if !anchored.contains(piece) {
                *row = self.closest.find(*vertex).map(|found| self.row(&found));
            }
        }
        let found = rows.iter().filter(|row| row.is_some()).count();
        log::debug!("{found} of {} vertices have or found weights", rows.len());
        let filled = Fill::new(vertices, &faces, &rows).run(&rows);
        own.iter()
            .zip(filled)
            .enumerate()
            .map(|(vertex, (own, row))| {
                own.or_else(|| strongest(row))
                    .ok_or_else(|| format!("vertex {vertex} finds no weights on the body"))
            })
            .collect()
    }
}

fn triangles(quads: &[Quad]) -> Vec<[u32; 3]> {
    let halves = |quad: &Quad| {
        let [a, b, c, d] = quad.corners;
        [[a, b, c], [a, c, d]]
    };
    quads.iter().flat_map(halves).collect()
}

/// Keeps a row's strongest bones, of equal ones the first, and makes them sum to 1. `None` for a row of nothing.
fn strongest(row: Row) -> Option<BoneWeights> {
    let mut order: Vec<(u16, f64)> = row.into_iter().filter(|(_, w)| *w > 0.0).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept = BoneWeights::default();
    order.truncate(kept.len());
    let sum: f64 = order.iter().map(|(_, weight)| weight).sum();
    for (slot, (bone, weight)) in kept.iter_mut().zip(order) {
        #[allow(clippy::cast_possible_truncation, reason = "weights are stored as f32")]
        let share = (weight / sum) as f32;
        *slot = (bone, share);
    }
    (sum > 0.0 && sum.is_finite()).then_some(kept)
}

/// The Laplace equation on the vertices without weights; those with weights are its boundary.
struct Fill {
    /// The vertices to fill.
    unknown: Vec<usize>,
    /// Neighbours of each unknown among the unknown (by their place there), and their edges' weights.
    inner: Vec<Vec<(usize, f64)>>,
    /// Neighbours of each unknown among the known (by vertex), and their edges' weights.
    outer: Vec<Vec<(usize, f64)>>,
    /// Sum of all its edges' weights, for each unknown.
    diagonal: Vec<f64>,
}

impl Fill {
    fn new(vertices: &[Vec3], faces: &[[u32; 3]], rows: &[Option<Row>]) -> Self {
        let mut edges: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        for face in faces {
            for k in 0..3 {
                let [a, b, apex] = [k, k + 1, k + 2].map(|k| face[k % 3] as usize);
                let cotangent =
                    cotangent(vertices[a] - vertices[apex], vertices[b] - vertices[apex]);
                if a != b {
                    *edges.entry((a, b)).or_default() += cotangent;
                    *edges.entry((b, a)).or_default() += cotangent;
                }
            }
        }
        let unknown: Vec<usize> = (0..rows.len()).filter(|v| rows[*v].is_none()).collect();
        let mut fill = Self {
            inner: vec![Vec::new(); unknown.len()],
            outer: vec![Vec::new(); unknown.len()],
            diagonal: vec![0.0; unknown.len()],
            unknown,
        };
        for ((from, to), weight) in edges {
            let Ok(slot) = fill.unknown.binary_search(&from) else {
                continue;
            };
            fill.diagonal[slot] += weight;
            match fill.unknown.binary_search(&to) {
                Ok(other) => fill.inner[slot].push((other, weight)),
                Err(_) => fill.outer[slot].push((to, weight)),
            }
        }
        fill
    }

    /// Fills the missing rows, bone by bone.
    fn run(&self, rows: &[Option<Row>]) -> Vec<Row> {
        let weight = |vertex: usize, bone: u16| -> f64 {
            let row = rows[vertex].as_ref();
            row.and_then(|row| row.get(&bone)).copied().unwrap_or(0.0)
        };
        let mut filled: Vec<Row> = rows.iter().map(|r| r.clone().unwrap_or_default()).collect();
        let boundary = self
            .outer
            .iter()
            .flatten()
            .filter_map(|(v, _)| rows[*v].as_ref());
        let bones: BTreeSet<u16> = boundary.flat_map(Row::keys).copied().collect();
        for bone in bones {
            let pull =
                |known: &Vec<(usize, f64)>| known.iter().map(|(v, w)| w * weight(*v, bone)).sum();
            let right: Vec<f64> = self.outer.iter().map(pull).collect();
            for (vertex, value) in self.unknown.iter().zip(self.solve(&right)) {
                if value > 0.0 {
                    filled[*vertex].insert(bone, value);
                }
            }
        }
        filled
    }

    /// Conjugate gradients, preconditioned by the diagonal. Single-threaded, so the same on every run.
    fn solve(&self, right: &[f64]) -> Vec<f64> {
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let scaled =
            |v: &[f64]| -> Vec<f64> { v.iter().zip(&self.diagonal).map(|(v, d)| v / d).collect() };
        let mut solution = vec![0.0; right.len()];
        let mut residual = right.to_vec();
        let mut direction = scaled(&residual);
        let mut energy = dot(&residual, &direction);
        let done = energy * TOLERANCE * TOLERANCE;
        // In exact arithmetic as many steps as unknowns suffice.
        for _ in 0..2 * right.len() {
            if energy <= done || !energy.is_finite() {
                break;
            }
            let image: Vec<f64> = (0..right.len())
                .map(|i| {
                    let around: f64 = self.inner[i].iter().map(|(j, w)| w * direction[*j]).sum();
                    self.diagonal[i] * direction[i] - around
                })
                .collect();
            let step = energy / dot(&direction, &image);
            for i in 0..right.len() {
                solution[i] += step * direction[i];
                residual[i] -= step * image[i];
            }
            let next = scaled(&residual);
            let before = std::mem::replace(&mut energy, dot(&residual, &next));
            for (d, n) in direction.iter_mut().zip(next) {
                *d = n + energy / before * *d;
            }
        }
        solution
    }
}

/// Half the cotangent of the angle between two edges, within bounds; 1/2 where a triangle has no area.
fn cotangent(a: Vec3, b: Vec3) -> f64 {
    let (a, b) = (a.as_dvec3(), b.as_dvec3());
    let area = a.cross(b).length();
    if area > 0.0 {
        0.5 * (a.dot(b) / area).clamp(COTANGENTS.0, COTANGENTS.1)
    } else {
        0.5
    }
}

#[cfg(test)]
mod tests;
