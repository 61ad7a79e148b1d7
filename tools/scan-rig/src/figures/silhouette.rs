//! Which pixels a mesh covers, grown or eroded.

use crate::pinhole::Pinhole;
use glam::{DVec2, DVec3};

/// The pixels, row by row from the top, whose centres any of the faces covers. Faces with a corner behind the camera are left out.
pub(super) fn silhouette(vertices: &[DVec3], faces: &[[u32; 3]], view: &Pinhole) -> Vec<bool> {
    let (width, height) = (view.width as usize, view.height as usize);
    let mut covered = vec![false; width * height];
    let projected: Vec<Option<DVec2>> = vertices.iter().map(|v| view.project(*v)).collect();
    for face in faces {
        let [Some(a), Some(b), Some(c)] =
            face.map(|v| projected.get(v as usize).copied().flatten())
        else {
            continue;
        };
        let low = a.min(b).min(c);
        let high = a.max(b).max(c);
        for y in pixel(low.y)..(pixel(high.y) + 1).min(height) {
            for x in pixel(low.x)..(pixel(high.x) + 1).min(width) {
                let p = DVec2::new(x as f64, y as f64) + 0.5;
                let sides =
                    [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(p - from));
                if sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0) {
                    covered[y * width + x] = true;
                }
            }
        }
    }
    covered
}

/// The pixels within `radius` pixels of one that is set.
pub(super) fn grown(set: &[bool], width: usize, radius: f64) -> Vec<bool> {
    let height = set.len() / width.max(1);
    let reach = pixel(radius);
    let mut out = vec![false; set.len()];
    for y in 0..height {
        for x in 0..width {
            if !set[y * width + x] {
                continue;
            }
            // What is surrounded by set pixels grows into nothing that these do not.
            let inner = x > 0 && x + 1 < width && y > 0 && y + 1 < height;
            let at = y * width + x;
            if inner
                && [at - 1, at + 1, at - width, at + width]
                    .iter()
                    .all(|n| set[*n])
            {
                out[at] = true;
                continue;
            }
            for v in y.saturating_sub(reach)..(y + reach + 1).min(height) {
                let across = (radius * radius - (v as f64 - y as f64).powi(2))
                    .max(0.0)
                    .sqrt();
                let across = pixel(across);
                for u in x.saturating_sub(across)..(x + across + 1).min(width) {
                    out[v * width + u] = true;
                }
            }
        }
    }
    out
}

/// The pixel that contains a coordinate; the first for what is left of or above the picture.
fn pixel(coordinate: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and what is no number becomes 0"
    )]
    let pixel = coordinate as usize;
    pixel
}
