//! Connected pieces of a mesh.

use crate::makehuman::Quad;

/// The smallest vertex of each vertex' connected piece.
pub(super) fn connected(vertices: usize, quads: &[Quad]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..).take(vertices).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for quad in quads {
        for corner in &quad.corners[1..] {
            let (a, b) = (
                root(&mut parent, quad.corners[0]),
                root(&mut parent, *corner),
            );
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    (0..).take(vertices).map(|v| root(&mut parent, v)).collect()
}
