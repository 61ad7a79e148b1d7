//! Loose pieces of a garment (a collar with its lapels) follow the cloth they lie on. Their own weights in the files
//! differ from those below, and a raised shoulder would come through.

use super::Part;
use super::assemble::Assembly;
use super::pieces::connected;
use crate::makehuman::BoneWeights;
use glam::Vec3;
use std::collections::BTreeMap;

/// Vertices below that a loose vertex follows.
const FOLLOWED: usize = 4;

/// A vertex of a loose piece, and those it follows with their shares.
pub(super) struct Loose {
    pub(super) vertex: usize,
    pub(super) below: [(usize, f32); FOLLOWED],
}

/// Finds the vertices of each cloth's smaller pieces and what they lie on, given the rest pose.
pub(super) fn find(assembly: &Assembly, vertices: &[Vec3]) -> Vec<Loose> {
    let pieces = connected(vertices.len(), &assembly.quads);
    let mut sizes: BTreeMap<(Part, u32), usize> = BTreeMap::new();
    for (part, piece) in assembly.vertex_parts.iter().zip(&pieces) {
        *sizes.entry((*part, *piece)).or_default() += 1;
    }
    let mut loose = Vec::new();
    for cloth in Part::ALL.into_iter().filter(|part| part.is_cloth()) {
        let of_cloth = sizes.iter().filter(|((part, _), _)| *part == cloth);
        let Some(((_, main), _)) = of_cloth.max_by_key(|(_, size)| **size) else {
            continue;
        };
        let (below, above): (Vec<usize>, Vec<usize>) = (0..vertices.len())
            .filter(|v| assembly.vertex_parts[*v] == cloth)
            .partition(|v| pieces[*v] == *main);
        if below.len() < FOLLOWED {
            continue;
        }
        for vertex in above {
            let mut near: Vec<(f32, usize)> = below
                .iter()
                .map(|v| (vertices[*v].distance(vertices[vertex]), *v))
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            let closeness = |k: usize| 1.0 / (near[k].0 + 1e-3);
            let sum: f32 = (0..FOLLOWED).map(closeness).sum();
            loose.push(Loose {
                vertex,
                below: std::array::from_fn(|k| (near[k].1, closeness(k) / sum)),
            });
        }
    }
    loose
}

/// Gives loose vertices the weights of the cloth below, over the rig's bones.
pub(super) fn follow(loose: &[Loose], weights: &mut [BoneWeights]) {
    for piece in loose {
        let mut mixed: BTreeMap<u16, f32> = BTreeMap::new();
        for (vertex, share) in piece.below {
            for (bone, weight) in weights[vertex] {
                *mixed.entry(bone).or_default() += share * weight;
            }
        }
        let mut strongest: Vec<(u16, f32)> = mixed.into_iter().collect();
        strongest.sort_by(|a, b| b.1.total_cmp(&a.1));
        strongest.truncate(FOLLOWED);
        let sum: f32 = strongest.iter().map(|(_, w)| w).sum();
        let row = &mut weights[piece.vertex];
        *row = BoneWeights::default();
        for (slot, (bone, weight)) in row.iter_mut().zip(strongest) {
            *slot = (bone, weight / sum);
        }
    }
}
