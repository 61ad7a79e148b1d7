//! Bridges between the person's layers: body, shirt, jacket and so on are separate surfaces, but a distance along the
//! person (geodesics of the virtual mass) must get from one to the other.

use glam::{IVec3, Vec3};
use std::collections::HashMap;

/// Layers closer than this touch, metres.
const REACH: f32 = 0.015;

/// Pairs of vertices, each the nearest of another connected piece within reach.
pub(super) fn bridges(vertices: &[Vec3], pieces: &[u32]) -> Vec<(u32, u32)> {
    let cell = |p: Vec3| (p / REACH).floor().as_ivec3();
    let mut grid: HashMap<IVec3, Vec<u32>> = HashMap::new();
    for (index, vertex) in (0..).zip(vertices) {
        grid.entry(cell(*vertex)).or_default().push(index);
    }
    let mut pairs = Vec::new();
    for (index, vertex) in (0u32..).zip(vertices) {
        let piece = pieces[index as usize];
        let home = cell(*vertex);
        let mut best: Option<(f32, u32)> = None;
        for k in 0..27 {
            let near = home + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
            for other in grid.get(&near).into_iter().flatten() {
                let distance = vertex.distance(vertices[*other as usize]);
                if pieces[*other as usize] != piece
                    && distance < REACH
                    && best.is_none_or(|(d, v)| (distance, *other) < (d, v))
                {
                    best = Some((distance, *other));
                }
            }
        }
        if let Some((_, other)) = best {
            pairs.push((index.min(other), index.max(other)));
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}
