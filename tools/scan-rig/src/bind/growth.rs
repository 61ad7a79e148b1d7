//! Gaussians that leave the body once it moves: what is on an arm's triangle but belongs to the trunk beside it is near the mesh as the
//! scan stands, and hangs in the air when the arm is lifted; and the ends of what is long stand off where the body bends.

use super::carried::Carried;
use crate::nearest::Nearest;
use crate::scan::Scan;
use glam::Vec3;
use rayon::prelude::*;

/// Where a Gaussian ends, in standard deviations along its two longest axes.
const END: f32 = 1.5;

/// What was inside of the body and comes out may be this much farther outside: the nearest face's normal is no exact side of the surface.
const COMES_OUT: f32 = 0.008;

/// How much farther from the mesh a Gaussian is in the worst of some poses than as the scan stands, metres.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Growth {
    /// Its centre; what was deep inside of the body and comes out has grown by what it is outside, less [`COMES_OUT`].
    pub(super) centre: f32,
    /// The worst one of its ends.
    pub(super) ends: f32,
}

/// The growth of every Gaussian. `seen` are the faces of the mesh that can be seen, `here` its vertices as the scan stands, `poses` in other
/// poses.
pub(super) fn growth(
    scan: &Scan,
    carried: &Carried,
    triangles: &[u32],
    faces: &[[u32; 3]],
    seen: &[[u32; 3]],
    here: &[Vec3],
    poses: &[Vec<Vec3>],
) -> Vec<Growth> {
    let mut corners: Vec<u32> = seen.as_flattened().to_vec();
    corners.sort_unstable();
    corners.dedup();
    let found = |scan: &Scan, vertices: &[Vec3]| -> Vec<Places> {
        let mut normals = vec![Vec3::ZERO; vertices.len()];
        let mut points: Vec<[f32; 3]> = Vec::with_capacity(seen.len() + corners.len());
        let mut facing: Vec<Vec3> = Vec::with_capacity(seen.len() + corners.len());
        for face in seen {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            let normal = (b - a).cross(c - a);
            for v in face {
                normals[*v as usize] += normal;
            }
            points.push(((a + b + c) / 3.0).to_array());
            facing.push(normal.normalize_or_zero());
        }
        points.extend(corners.iter().map(|v| vertices[*v as usize].to_array()));
        facing.extend((corners.iter()).map(|v| normals[*v as usize].normalize_or_zero()));
        let tree = Nearest::new(&points);
        let distance = |point: Vec3| {
            let found = tree.one(&point.to_array());
            found.map_or(f32::INFINITY, |found| found.squared.sqrt())
        };
        (0..scan.len())
            .into_par_iter()
            .map(|at| {
                let centre = scan.positions[at];
                let [first, second] = scan.long_axes(at).map(|axis| axis * END);
                let height = tree.one(&centre.to_array()).map_or(0.0, |found| {
                    (centre - Vec3::from(points[found.at])).dot(facing[found.at])
                });
                Places {
                    centre: distance(centre),
                    outside: height.max(0.0),
                    ends: [first, -first, second, -second].map(|end| distance(centre + end)),
                }
            })
            .collect()
    };
    let before = found(scan, here);
    let mut worst = vec![Growth::default(); scan.len()];
    for vertices in poses {
        let posed = carried.posed(scan, triangles, faces, vertices);
        let after = found(&posed, vertices);
        for ((worst, before), after) in worst.iter_mut().zip(&before).zip(after) {
            let farther = after.centre - before.centre;
            worst.centre = worst
                .centre
                .max(farther)
                .max(after.outside - before.outside - COMES_OUT);
            for (after, before) in after.ends.iter().zip(before.ends) {
                worst.ends = worst.ends.max(after - before);
            }
        }
    }
    worst
}

/// Where a Gaussian is relative to the mesh, metres.
struct Places {
    /// Distance of its centre.
    centre: f32,
    /// How far the centre is outside.
    outside: f32,
    /// Distances of its ends.
    ends: [f32; 4],
}
