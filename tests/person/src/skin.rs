//! The Gaussians and controllers on the puppet's surface.

use super::{Random, index};
use glam::{Mat3, Quat, Vec3};
use spmm3::{GaussianSet, SH_C0, Template};

/// Gaussians over the surface, as many to a face as its area deserves, in the faces' order.
pub(super) fn scatter(
    template: &Template,
    colours: &[Vec3],
    count: usize,
    random: &mut Random,
) -> (GaussianSet, Vec<u32>, Vec<[f32; 2]>) {
    let corners = |face: &[u32; 3]| face.map(|v| template.vertices()[v as usize]);
    let area = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).length() / 2.0;
    let total: f32 = template.faces().iter().map(|f| area(corners(f))).sum();
    let radius = (total / count as f32).sqrt() * 0.6;
    let mut out = GaussianSet::zeroed(0);
    let (mut triangles, mut barycentrics) = (Vec::new(), Vec::new());
    let mut reached = 0.0f64;
    for (triangle, face) in template.faces().iter().enumerate() {
        let [a, b, c] = corners(face);
        reached += f64::from(area([a, b, c])) / f64::from(total) * count as f64;
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
        let x = (b - a).normalize_or(Vec3::X);
        let flat = Quat::from_mat3(&Mat3::from_cols(x, normal.cross(x), normal));
        let last = triangle + 1 == template.faces().len();
        while out.len() < count && ((out.len() as f64) < reached || last) {
            let (mut v, mut w) = (random.unit(), random.unit());
            if v + w > 1.0 {
                (v, w) = (1.0 - v, 1.0 - w);
            }
            let turn = Quat::from_rotation_z(random.signed() * 3.0);
            let tilt = Quat::from_scaled_axis(random.vector() * 0.1);
            let spread = Vec3::new(random.signed(), random.signed(), random.signed()) * 0.25;
            out.positions
                .push(a + (b - a) * v + (c - a) * w + normal * random.signed() * 0.002);
            out.rotations.push(flat * turn * tilt);
            out.log_scales
                .push(spread + Vec3::new(radius.ln(), radius.ln(), (radius * 0.3).ln()));
            out.opacity_logits.push(3.0 + random.signed());
            let shade = colours[triangle] + random.vector() * 0.06;
            out.colours.push((shade - 0.5) / SH_C0);
            triangles.push(index(triangle));
            barycentrics.push([v, w]);
        }
    }
    (out, triangles, barycentrics)
}

/// Farthest-point sampling: `count` vertices spread over the body.
pub(super) fn spread(vertices: &[Vec3], count: usize) -> Vec<u32> {
    let mut distance = vec![f32::INFINITY; vertices.len()];
    let mut chosen = vec![0usize];
    while chosen.len() < count {
        let from = vertices[chosen[chosen.len() - 1]];
        for (known, vertex) in distance.iter_mut().zip(vertices) {
            *known = known.min(vertex.distance(from));
        }
        let farthest = (0..vertices.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b]));
        chosen.push(farthest.unwrap_or_default());
    }
    chosen.into_iter().map(index).collect()
}
