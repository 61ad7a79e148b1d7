//! Gaussians that leave the body once it moves: what is on an arm's triangle but belongs to the trunk beside it is near the mesh as the
//! scan stands, and hangs in the air when the arm is lifted; and the ends of what is long stand off where the body bends.

use super::carried::Carried;
use crate::nearest::Nearest;
use crate::scan::Scan;
use glam::Vec3;
use rayon::prelude::*;

/// Where a Gaussian ends, in standard deviations along its longest axis.
const END: f32 = 1.5;

/// How much farther from the mesh a Gaussian is in the worst of some poses than as the scan stands, metres.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Growth {
    /// Its centre.
    pub(super) centre: f32,
    /// The worse one of its two ends.
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
    let distances = |scan: &Scan, vertices: &[Vec3]| -> Vec<[f32; 3]> {
        let middle =
            |face: &[u32; 3]| face.iter().map(|v| vertices[*v as usize]).sum::<Vec3>() / 3.0;
        let mut points: Vec<[f32; 3]> = seen.iter().map(|face| middle(face).to_array()).collect();
        points.extend(corners.iter().map(|v| vertices[*v as usize].to_array()));
        let tree = Nearest::new(&points);
        let distance = |point: Vec3| {
            let found = tree.one(&point.to_array());
            found.map_or(f32::INFINITY, |found| found.squared.sqrt())
        };
        (0..scan.len())
            .into_par_iter()
            .map(|at| {
                let centre = scan.positions[at];
                let end = scan.longest(at) * END;
                [centre, centre + end, centre - end].map(distance)
            })
            .collect()
    };
    let before = distances(scan, here);
    let mut worst = vec![Growth::default(); scan.len()];
    for vertices in poses {
        let posed = carried.posed(scan, triangles, faces, vertices);
        let after = distances(&posed, vertices);
        for ((worst, before), after) in worst.iter_mut().zip(&before).zip(after) {
            worst.centre = worst.centre.max(after[0] - before[0]);
            worst.ends = worst
                .ends
                .max(after[1] - before[1])
                .max(after[2] - before[2]);
        }
    }
    worst
}
