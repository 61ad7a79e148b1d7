//! Pixels grown or eroded.

use crate::mesh_depth::pixel;

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
