//! How far a mesh is from a view, pixel by pixel.

use crate::pinhole::Pinhole;
use glam::{DVec2, DVec3};

/// The depth of the nearest face along the camera's axis, metres, row by row from the top; infinite where no face covers a pixel's
/// centre. Faces with a corner behind the camera are left out.
pub(crate) fn depths(vertices: &[DVec3], faces: &[[u32; 3]], view: &Pinhole) -> Vec<f64> {
    let (width, height) = (view.width as usize, view.height as usize);
    // One over the depth is linear in the picture.
    let mut nearness = vec![0.0f64; width * height];
    let projected: Vec<Option<(DVec2, f64)>> = (vertices.iter())
        .map(|v| Some((view.project(*v)?, 1.0 / view.camera_point(*v).z)))
        .collect();
    for face in faces {
        let [Some((a, near_a)), Some((b, near_b)), Some((c, near_c))] =
            face.map(|v| projected.get(v as usize).copied().flatten())
        else {
            continue;
        };
        let area = (b - a).perp_dot(c - a);
        if area == 0.0 {
            continue;
        }
        let low = a.min(b).min(c);
        let high = a.max(b).max(c);
        for y in pixel(low.y)..(pixel(high.y) + 1).min(height) {
            for x in pixel(low.x)..(pixel(high.x) + 1).min(width) {
                let p = DVec2::new(x as f64, y as f64) + 0.5;
                let share_b = (p - a).perp_dot(c - a) / area;
                let share_c = (b - a).perp_dot(p - a) / area;
                if share_b >= 0.0 && share_c >= 0.0 && share_b + share_c <= 1.0 {
                    let near = near_a + share_b * (near_b - near_a) + share_c * (near_c - near_a);
                    let slot = &mut nearness[y * width + x];
                    *slot = slot.max(near);
                }
            }
        }
    }
    nearness.into_iter().map(|near| 1.0 / near).collect()
}

/// The pixel that contains a coordinate; the first for what is left of or above the picture.
pub(crate) fn pixel(coordinate: impl Into<f64>) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and what is no number becomes 0"
    )]
    let pixel = coordinate.into() as usize;
    pixel
}
