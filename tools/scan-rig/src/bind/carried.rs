//! Gaussians in the frames of the triangles that carry them.

use crate::scan::Scan;
use glam::{Quat, Vec3};
use half::f16;
use rayon::prelude::*;
use spmm3::triangle_frame;

/// Where each Gaussian is on and above its triangle, and how it is turned in the triangle's frame (`spmm3::triangle_frame`).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Carried {
    /// Shares of the triangle's second and third corner, 0..=1.
    pub barycentrics: Vec<[f32; 2]>,
    /// From that point of the triangle, in its frame, metres.
    pub offsets: Vec<Vec3>,
    /// Relative to the triangle's frame.
    pub rotations: Vec<Quat>,
}

impl Carried {
    /// Takes Gaussians and the mesh in the same pose; `triangles` has one face of the mesh for each.
    #[must_use]
    pub fn new(scan: &Scan, triangles: &[u32], faces: &[[u32; 3]], vertices: &[Vec3]) -> Self {
        let all: Vec<_> = triangles
            .par_iter()
            .enumerate()
            .map(|(at, triangle)| {
                let corners = faces[*triangle as usize].map(|v| vertices[v as usize]);
                let shares = shares_of_nearest(scan.positions[at], corners);
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

    /// These, rounded as an avatar's package rounds them.
    #[must_use]
    pub fn quantised(mut self) -> Self {
        let round = |value: f32| f16::from_f32(value).to_f32();
        for shares in &mut self.barycentrics {
            *shares = shares.map(round);
        }
        for offset in &mut self.offsets {
            *offset = offset.to_array().map(round).into();
        }
        for rotation in &mut self.rotations {
            *rotation = Quat::from_array(rotation.to_array().map(round)).normalize();
        }
        self
    }

    /// The Gaussians on the mesh in another pose. `scan` gives what does not change.
    #[must_use]
    pub fn posed(
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
    point(corners, shares_of_nearest(p, corners))
}

/// Shares of the second and the third corner in the triangle's point that is nearest to `p` (Ericson, "Real-Time Collision Detection",
/// 2004, section 5.1.5).
fn shares_of_nearest(p: Vec3, [a, b, c]: [Vec3; 3]) -> [f32; 2] {
    let (ab, ac) = (b - a, c - a);
    let (to_a, to_b, to_c) = (p - a, p - b, p - c);
    let (d1, d2) = (ab.dot(to_a), ac.dot(to_a));
    let (d3, d4) = (ab.dot(to_b), ac.dot(to_b));
    let (d5, d6) = (ab.dot(to_c), ac.dot(to_c));
    let share = |part: f32, rest: f32| {
        let whole = part + rest;
        if whole > 0.0 {
            (part / whole).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    if d1 <= 0.0 && d2 <= 0.0 {
        return [0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [1.0, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 1.0];
    }
    let at_c = d1 * d4 - d3 * d2;
    if at_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return [share(d1, -d3), 0.0];
    }
    let at_b = d5 * d2 - d1 * d6;
    if at_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return [0.0, share(d2, -d6)];
    }
    let at_a = d3 * d6 - d5 * d4;
    if at_a <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = share(d4 - d3, d5 - d6);
        return [1.0 - w, w];
    }
    let whole = at_a + at_b + at_c;
    if whole > 0.0 {
        [at_b / whole, at_c / whole]
    } else {
        [0.0, 0.0]
    }
}
