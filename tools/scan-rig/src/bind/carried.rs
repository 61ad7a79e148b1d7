//! Gaussians in the frames of the triangles that carry them.

use crate::scan::Scan;
use glam::{Quat, Vec3};
use rayon::prelude::*;
use spmm3::{shares_of_closest, triangle_frame};

/// Where each Gaussian is on and above its triangle, and how it is turned in the triangle's frame (`spmm3::triangle_frame`).
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Carried {
    /// Shares of the triangle's second and third corner, 0..=1.
    pub(crate) barycentrics: Vec<[f32; 2]>,
    /// From that point of the triangle, in its frame, metres.
    pub(crate) offsets: Vec<Vec3>,
    /// Relative to the triangle's frame.
    pub(crate) rotations: Vec<Quat>,
}

impl Carried {
    /// Takes Gaussians and the mesh in the same pose; `triangles` has one face of the mesh for each.
    #[must_use]
    pub(crate) fn new(
        scan: &Scan,
        triangles: &[u32],
        faces: &[[u32; 3]],
        vertices: &[Vec3],
    ) -> Self {
        let all: Vec<_> = triangles
            .par_iter()
            .enumerate()
            .map(|(at, triangle)| {
                let corners = faces[*triangle as usize].map(|v| vertices[v as usize]);
                let shares = shares(scan.positions[at], corners);
                let world_from_local = triangle_frame(corners);
                let anchor = point(corners, shares);
                (
                    shares,
                    world_from_local.transpose() * (scan.positions[at] - anchor),
                    (Quat::from_mat3(&world_from_local).conjugate() * scan.rotations[at])
                        .normalize(),
                )
            })
            .collect();
        let mut carried = Self::default();
        for (shares, offset, rotation) in all {
            carried.barycentrics.push(shares);
            carried.offsets.push(offset);
            carried.rotations.push(rotation);
        }
        carried
    }

    /// The Gaussians on the mesh in another pose. `scan` gives what does not change.
    #[must_use]
    pub(crate) fn posed(
        &self,
        scan: &Scan,
        triangles: &[u32],
        faces: &[[u32; 3]],
        vertices: &[Vec3],
    ) -> Scan {
        let (positions, rotations) = triangles
            .par_iter()
            .enumerate()
            .map(|(at, triangle)| {
                let corners = faces[*triangle as usize].map(|v| vertices[v as usize]);
                let world_from_local = triangle_frame(corners);
                (
                    point(corners, self.barycentrics[at]) + world_from_local * self.offsets[at],
                    (Quat::from_mat3(&world_from_local) * self.rotations[at]).normalize(),
                )
            })
            .unzip();
        Scan {
            positions,
            rotations,
            scales: scan.scales.clone(),
            opacities: scan.opacities.clone(),
            colours: scan.colours.clone(),
        }
    }
}

fn point([a, b, c]: [Vec3; 3], [v, w]: [f32; 2]) -> Vec3 {
    a + (b - a) * v + (c - a) * w
}

/// The point of a triangle that is nearest to `p`.
pub(super) fn nearest_point(p: Vec3, corners: [Vec3; 3]) -> Vec3 {
    point(corners, shares(p, corners))
}

/// Where a Gaussian at `p` sits on its triangle: shares of the second and the third corner in the triangle's point that is nearest to it.
pub(crate) fn shares(p: Vec3, corners: [Vec3; 3]) -> [f32; 2] {
    let [_, v, w] = shares_of_closest(p, corners);
    [v, w]
}
