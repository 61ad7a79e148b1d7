//! Gaussians that leave the body once it moves: what is on an arm's triangle but belongs to the trunk beside it is near the mesh as the
//! scan stands, and hangs in the air when the arm is lifted.

use super::carried::Carried;
use crate::nearest::Nearest;
use crate::scan::Scan;
use glam::Vec3;
use rayon::prelude::*;

/// How much farther from the mesh a Gaussian may be in another pose, metres.
const MOST: f32 = 0.01;

/// For each Gaussian whether it stays with the mesh in all of the poses. `outer` says which faces can be seen.
#[must_use]
pub fn stays(
    scan: &Scan,
    carried: &Carried,
    triangles: &[u32],
    faces: &[[u32; 3]],
    outer: impl Fn(usize) -> bool,
    here: &[Vec3],
    poses: &[Vec<Vec3>],
) -> Vec<bool> {
    let seen: Vec<[u32; 3]> = faces
        .iter()
        .enumerate()
        .filter(|(at, _)| outer(*at))
        .map(|(_, face)| *face)
        .collect();
    let tree = |vertices: &[Vec3]| {
        let mut points: Vec<[f32; 3]> = seen
            .iter()
            .map(|face| (face.iter().map(|v| vertices[*v as usize]).sum::<Vec3>() / 3.0).to_array())
            .collect();
        let mut corners: Vec<u32> = seen.as_flattened().to_vec();
        corners.sort_unstable();
        corners.dedup();
        points.extend(corners.iter().map(|v| vertices[*v as usize].to_array()));
        Nearest::new(&points)
    };
    let distances = |tree: &Nearest<3>, positions: &[Vec3]| -> Vec<f32> {
        positions
            .par_iter()
            .map(|p| {
                tree.one(&p.to_array())
                    .map_or(f32::INFINITY, |found| found.squared.sqrt())
            })
            .collect()
    };
    let before = distances(&tree(here), &scan.positions);
    let mut stays = vec![true; scan.len()];
    for vertices in poses {
        let posed = carried.posed(scan, triangles, faces, vertices);
        let after = distances(&tree(vertices), &posed.positions);
        for ((stays, before), after) in stays.iter_mut().zip(&before).zip(after) {
            *stays &= after - before <= MOST;
        }
    }
    stays
}
