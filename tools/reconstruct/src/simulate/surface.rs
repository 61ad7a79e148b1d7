//! A triangle mesh's neighbourhoods and normals, shared by the cloth, the creases and the fits.

use glam::Vec3;
use std::collections::HashMap;

/// The neighbours of each vertex of a mesh.
#[derive(Debug, Clone)]
pub struct Surface {
    faces: Vec<[u32; 3]>,
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    edges: Vec<[u32; 2]>,
    bends: Vec<[u32; 2]>,
}

impl Surface {
    /// Reads the neighbourhoods of `faces` over `vertices` vertices.
    #[must_use]
    pub fn new(vertices: usize, faces: &[[u32; 3]]) -> Self {
        let mut opposite: HashMap<(u32, u32), u32> = HashMap::new();
        let (mut edges, mut bends) = (Vec::new(), Vec::new());
        for face in faces {
            for corner in 0..3 {
                let (a, b, across) = (face[corner], face[(corner + 1) % 3], face[(corner + 2) % 3]);
                match opposite.insert((a.min(b), a.max(b)), across) {
                    None => edges.push([a.min(b), a.max(b)]),
                    Some(other) if other != across => {
                        bends.push([other.min(across), other.max(across)]);
                    }
                    Some(_) => {}
                }
            }
        }
        let mut starts = vec![0u32; vertices + 1];
        for vertex in edges.iter().flatten() {
            starts[*vertex as usize + 1] += 1;
        }
        for v in 0..vertices {
            starts[v + 1] += starts[v];
        }
        let mut next = starts.clone();
        let mut neighbours = vec![0; edges.len() * 2];
        for [a, b] in &edges {
            for (from, to) in [(*a, *b), (*b, *a)] {
                neighbours[next[from as usize] as usize] = to;
                next[from as usize] += 1;
            }
        }
        Self {
            faces: faces.to_vec(),
            starts,
            neighbours,
            edges,
            bends,
        }
    }

    /// Vertices that share an edge with `vertex`.
    #[must_use]
    pub fn neighbours(&self, vertex: usize) -> &[u32] {
        &self.neighbours[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    /// Every edge once, lower vertex first.
    #[must_use]
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// The two vertices across each inner edge.
    #[must_use]
    pub fn bends(&self) -> &[[u32; 2]] {
        &self.bends
    }

    /// Unit normals, area-weighted; zero where no face is.
    #[must_use]
    pub fn normals(&self, points: &[Vec3]) -> Vec<Vec3> {
        let mut normals = vec![Vec3::ZERO; points.len()];
        for face in &self.faces {
            let [a, b, c] = face.map(|v| points[v as usize]);
            let normal = (b - a).cross(c - a);
            for v in face {
                normals[*v as usize] += normal;
            }
        }
        normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
        normals
    }

    /// Replaces each value by the mean of itself and its neighbours' mean, `rounds` times.
    pub fn smooth(&self, values: &mut Vec<f32>, rounds: usize) {
        for _ in 0..rounds {
            *values = (0..values.len())
                .map(|v| {
                    let around = self.neighbours(v);
                    if around.is_empty() {
                        return values[v];
                    }
                    let sum: f32 = around.iter().map(|n| values[*n as usize]).sum();
                    0.5 * (values[v] + sum / around.len() as f32)
                })
                .collect();
        }
    }
}
