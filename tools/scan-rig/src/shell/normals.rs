//! Normals of the faces that are chosen.

use crate::normals::vertex_normals;
use glam::DVec3;

/// Unit normals at the vertices, weighted by the areas of the faces that `take` chooses; up where there is none.
#[must_use]
pub(crate) fn normals(
    vertices: &[DVec3],
    faces: &[[u32; 3]],
    take: impl Fn(usize) -> bool,
) -> Vec<DVec3> {
    let taken = (faces.iter().enumerate()).filter(|(at, _)| take(*at));
    vertex_normals(vertices, taken.map(|(_, face)| face), DVec3::Y)
}
