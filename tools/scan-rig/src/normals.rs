//! Normals of meshes.

use glam::DVec3;
use rayon::prelude::*;

/// `[N_v]` unit normals of vertices, weighted by the faces' areas; `faceless` where a vertex has no face.
#[must_use]
pub fn vertex_normals<'a>(
    vertices: &[DVec3],
    faces: impl IntoIterator<Item = &'a [u32; 3]>,
    faceless: DVec3,
) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; vertices.len()];
    for face in faces {
        let [a, b, c] = face.map(|v| vertices[v as usize]);
        let normal = (b - a).cross(c - a);
        face.iter().for_each(|v| sums[*v as usize] += normal);
    }
    sums.par_iter_mut()
        .for_each(|normal| *normal = normal.normalize_or(faceless));
    sums
}
