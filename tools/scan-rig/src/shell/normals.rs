//! Normals of a mesh.

use glam::DVec3;

/// Unit normals at the vertices, weighted by the areas of the faces that `take` chooses; up where there is none.
#[must_use]
pub(crate) fn normals(
    vertices: &[DVec3],
    faces: &[[u32; 3]],
    take: impl Fn(usize) -> bool,
) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; vertices.len()];
    for (_, face) in faces.iter().enumerate().filter(|(at, _)| take(*at)) {
        let [a, b, c] = face.map(|v| vertices[v as usize]);
        for v in face {
            normals[*v as usize] += (b - a).cross(c - a);
        }
    }
    let unit = |normal: DVec3| normal.try_normalize().unwrap_or(DVec3::Y);
    normals.into_iter().map(unit).collect()
}
