//! Values over a mesh that continue smoothly where they are not known: harmonic in-painting.
//!
//! The values satisfy Laplace's equation with the cotangents of the mesh as weights and the known vertices as the border (Pinkall and
//! Polthier 1993), solved by conjugate gradients. Weights are kept positive, so that nothing leaves the range of the known values.

use crate::conjugate_gradients::{self, Enough};
use glam::DVec3;
use rayon::prelude::*;

/// Bounds of the cotangents that weigh edges.
const COTANGENTS: (f64, f64) = (0.05, 20.0);

/// When a fill is near enough.
const ENOUGH: Enough = Enough {
    left: 1e-7,
    steps: 2000,
};

/// A mesh's edges with weights, by vertex.
#[derive(Debug, Clone)]
pub struct Edges {
    /// Where the edges of each vertex begin, and the end of the last.
    starts: Vec<u32>,
    /// The other end of each edge, and its weight.
    ends: Vec<(u32, f64)>,
}

impl Edges {
    /// The edges of triangles over `vertices`. Triangles that name a vertex that does not exist are left out.
    #[must_use]
    pub fn new(vertices: &[DVec3], faces: impl Iterator<Item = [u32; 3]>) -> Self {
        let mut pairs: Vec<(u32, u32, f64)> = Vec::new();
        for face in faces {
            if face.iter().any(|v| *v as usize >= vertices.len()) {
                continue;
            }
            for k in 0..3 {
                let [apex, from, to] = [face[k], face[(k + 1) % 3], face[(k + 2) % 3]];
                let (u, v) = (
                    vertices[from as usize] - vertices[apex as usize],
                    vertices[to as usize] - vertices[apex as usize],
                );
                let cotangent = u.dot(v) / u.cross(v).length().max(1e-15);
                let weight = 0.5
                    * if cotangent.is_finite() {
                        cotangent
                    } else {
                        0.0
                    };
                pairs.push((from, to, weight));
                pairs.push((to, from, weight));
            }
        }
        pairs.par_sort_by_key(|(from, to, _)| (*from, *to));
        let mut starts = vec![0_u32; vertices.len() + 1];
        let mut ends: Vec<(u32, f64)> = Vec::with_capacity(pairs.len() / 2);
        let mut last = None;
        for (from, to, weight) in pairs {
            if last == Some((from, to)) {
                if let Some(end) = ends.last_mut() {
                    end.1 += weight;
                }
            } else {
                ends.push((to, weight));
                starts[from as usize + 1] += 1;
                last = Some((from, to));
            }
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        for end in &mut ends {
            end.1 = end.1.clamp(COTANGENTS.0, COTANGENTS.1);
        }
        Self { starts, ends }
    }

    /// The neighbours of a vertex, with weights.
    #[must_use]
    pub fn of(&self, vertex: usize) -> &[(u32, f64)] {
        &self.ends[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    /// How many vertices there are.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.starts.len() - 1
    }

    /// The values, unchanged where `known`, harmonic elsewhere. A vertex that no known one can be reached from keeps its own.
    /// `values` and `known` have one entry a vertex.
    #[must_use]
    pub fn fill(&self, values: &[DVec3], known: &[bool]) -> Vec<DVec3> {
        let reached = self.reached(known);
        let solve: Vec<usize> = (0..self.vertices())
            .filter(|v| !known[*v] && reached[*v].is_some())
            .collect();
        let mut row_of = vec![u32::MAX; self.vertices()];
        for (row, v) in solve.iter().enumerate() {
            row_of[*v] = u32::try_from(row).unwrap_or(u32::MAX);
        }
        let diagonal: Vec<f64> = solve
            .iter()
            .map(|v| self.of(*v).iter().map(|(_, w)| w).sum::<f64>())
            .collect();
        // The Laplacian applied to a field that is zero on the known vertices.
        let apply = |field: &[DVec3], out: &mut [DVec3]| {
            (solve.par_iter().zip(&diagonal).zip(out))
                .enumerate()
                .for_each(|(row, ((v, diagonal), out))| {
                    let mut sum = field[row] * *diagonal;
                    for (to, weight) in self.of(*v) {
                        if let Some(value) = field.get(row_of[*to as usize] as usize) {
                            sum -= *weight * *value;
                        }
                    }
                    *out = sum;
                });
        };
        let right: Vec<DVec3> = (solve.iter())
            .map(|v| {
                let near = self.of(*v).iter().filter(|(to, _)| known[*to as usize]);
                near.map(|(to, w)| *w * values[*to as usize]).sum()
            })
            .collect();
        // A start that is near the solution: the value of the nearest known vertex.
        let mut rows: Vec<DVec3> = (solve.iter())
            .map(|v| values[reached[*v].map_or(*v, |source| source as usize)])
            .collect();
        conjugate_gradients::solve(
            &right,
            &mut rows,
            apply,
            |row, value| value / diagonal[row],
            ENOUGH,
        );
        let mut filled = values.to_vec();
        for (v, value) in solve.iter().zip(rows) {
            filled[*v] = value;
        }
        filled
    }

    /// For each vertex the known vertex that is fewest edges away (itself if known); nothing if none can be reached.
    #[must_use]
    pub fn reached(&self, known: &[bool]) -> Vec<Option<u32>> {
        let mut source: Vec<Option<u32>> = vec![None; self.vertices()];
        let mut front: Vec<u32> = Vec::new();
        for (v, known) in known.iter().enumerate() {
            if *known {
                let v32 = u32::try_from(v).unwrap_or(u32::MAX);
                source[v] = Some(v32);
                front.push(v32);
            }
        }
        while !front.is_empty() {
            let mut next = Vec::new();
            for v in front {
                let from = source[v as usize];
                for (to, _) in self.of(v as usize) {
                    let slot = &mut source[*to as usize];
                    if slot.is_none() {
                        *slot = from;
                        next.push(*to);
                    }
                }
            }
            front = next;
        }
        source
    }

    /// Each value moved towards the mean of its neighbours, `rounds` times.
    #[must_use]
    pub fn smoothed(&self, values: &[DVec3], rounds: usize) -> Vec<DVec3> {
        let mut values = values.to_vec();
        for _ in 0..rounds {
            values = (0..self.vertices())
                .into_par_iter()
                .map(|v| {
                    let near = self.of(v);
                    if near.is_empty() {
                        return values[v];
                    }
                    let sum: DVec3 = near.iter().map(|(to, _)| values[*to as usize]).sum();
                    values[v].lerp(sum / near.len() as f64, 0.5)
                })
                .collect();
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of rhombi halved into triangles, its vertices pushed about within the plane.
    fn grid(n: u32, jitter: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut rng = fastrand::Rng::with_seed(5);
        let vertices = (0..n * n)
            .map(|k| {
                let mut push = || (rng.f64() - 0.5) * jitter;
                let (x, y) = (f64::from(k % n) + push(), f64::from(k / n) + push());
                // Sheared, so that the triangles have no right angles.
                DVec3::new(x - 0.5 * y, 0.9 * y, 0.0)
            })
            .collect();
        let faces = (0..(n - 1) * (n - 1))
            .flat_map(|k| {
                let a = k / (n - 1) * n + k % (n - 1);
                [[a, a + 1, a + n + 1], [a, a + n + 1, a + n]]
            })
            .collect();
        (vertices, faces)
    }

    #[test]
    fn the_fill_of_a_linear_field_is_that_field() {
        let (vertices, faces) = grid(30, 0.2);
        let truth: Vec<DVec3> = vertices
            .iter()
            .map(|v| {
                DVec3::new(
                    0.3 + 0.02 * v.x,
                    0.5 - 0.01 * v.y,
                    0.1 + 0.003 * (v.x + v.y),
                )
            })
            .collect();
        let known: Vec<bool> = (0..900)
            .map(|k| k % 30 % 29 == 0 || k / 30 % 29 == 0)
            .collect();
        let start: Vec<DVec3> = truth
            .iter()
            .zip(&known)
            .map(|(t, k)| if *k { *t } else { DVec3::ZERO })
            .collect();
        let filled = Edges::new(&vertices, faces.iter().copied()).fill(&start, &known);
        let worst = filled
            .iter()
            .zip(&truth)
            .map(|(a, b)| a.distance(*b))
            .fold(0.0, f64::max);
        assert!(worst < 1e-5, "off by {worst}");
    }

    #[test]
    fn a_fill_stays_within_the_known_values_and_leaves_what_it_cannot_reach() {
        let (mut vertices, mut faces) = grid(12, 0.8);
        vertices.extend([DVec3::X * 50.0, DVec3::X * 51.0, DVec3::new(50.0, 1.0, 0.0)]);
        faces.push([144, 145, 146]);
        let mut known = vec![false; 147];
        let mut values = vec![DVec3::splat(0.25); 147];
        for (k, v) in [(0, 0.0), (70, 1.0), (143, 0.5)] {
            known[k] = true;
            values[k] = DVec3::splat(v);
        }
        let filled = Edges::new(&vertices, faces.iter().copied()).fill(&values, &known);
        assert!(
            filled.iter().all(|v| (-1e-9..=1.0 + 1e-9).contains(&v.x)),
            "outside of the known values"
        );
        assert_eq!(filled[145], DVec3::splat(0.25), "an island was changed");
        assert!(
            filled[71].x > 0.5,
            "next to the brightest: {}",
            filled[71].x
        );
    }
}
