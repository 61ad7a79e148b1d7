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

/// Where a point is relative to the skin, metres.
#[derive(Debug, Clone, Copy)]
struct Off {
    distance: f32,
    /// Over the plane of the nearest corner or middle of a face, negative inside: what lies on the skin beside it has none, however the skin bends.
    height: f32,
}

impl Off {
    const NOWHERE: Self = Self {
        distance: f32::INFINITY,
        height: 0.0,
    };
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
    let places = |scan: &Scan, vertices: &[Vec3]| -> Vec<[Off; 3]> {
        let middle =
            |face: &[u32; 3]| face.iter().map(|v| vertices[*v as usize]).sum::<Vec3>() / 3.0;
        let mut points: Vec<[f32; 3]> = seen.iter().map(|face| middle(face).to_array()).collect();
        points.extend(corners.iter().map(|v| vertices[*v as usize].to_array()));
        let mut normals = vec![Vec3::ZERO; vertices.len()];
        let mut outwards = Vec::with_capacity(points.len());
        for face in seen {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            let normal = (b - a).cross(c - a);
            outwards.push(normal.normalize_or_zero());
            face.iter().for_each(|v| normals[*v as usize] += normal);
        }
        outwards.extend((corners.iter()).map(|v| normals[*v as usize].normalize_or_zero()));
        let tree = Nearest::new(&points);
        let off = |point: Vec3| {
            let found = tree.one(&point.to_array());
            found.map_or(Off::NOWHERE, |found| Off {
                distance: found.squared.sqrt(),
                height: (point - Vec3::from(points[found.at])).dot(outwards[found.at]),
            })
        };
        (0..scan.len())
            .into_par_iter()
            .map(|at| {
                let centre = scan.positions[at];
                let end = scan.longest(at) * END;
                [centre, centre + end, centre - end].map(off)
            })
            .collect()
    };
    let before = places(scan, here);
    let mut worst = vec![Growth::default(); scan.len()];
    for vertices in poses {
        let posed = carried.posed(scan, triangles, faces, vertices);
        let after = places(&posed, vertices);
        // What comes out of the body leaves it as well, however deep it was.
        let grown = |before: Off, after: Off| {
            (after.distance - before.distance).max(after.height - before.height.max(0.0))
        };
        for ((worst, before), after) in worst.iter_mut().zip(&before).zip(after) {
            worst.centre = worst.centre.max(grown(before[0], after[0]));
            let ends = grown(before[1], after[1]).max(grown(before[2], after[2]));
            worst.ends = worst.ends.max(ends);
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn what_comes_out_of_the_body_leaves_it_however_deep_it_was() {
        // A body that is all below z = 0, and a triangle apart from it that carries a Gaussian which is deep inside.
        let mut here = Vec::new();
        let mut faces: Vec<[u32; 3]> = Vec::new();
        for at in 0..400_u16 {
            let (x, y) = (f32::from(at % 20), f32::from(at / 20));
            here.push(Vec3::new(x - 9.5, y - 9.5, 0.0) * 0.01);
            if at % 20 < 19 && at / 20 < 19 {
                let at = u32::from(at);
                faces.extend([[at, at + 1, at + 21], [at, at + 21, at + 20]]);
            }
        }
        let seen = faces.clone();
        let carrier = [Vec3::ZERO, Vec3::X * 0.02, Vec3::Y * 0.02].map(|at| at - Vec3::Z * 0.06);
        here.extend(carrier);
        faces.push([400, 401, 402]);
        let scan = Scan {
            positions: vec![Vec3::new(0.002, 0.003, -0.05)],
            rotations: vec![Quat::IDENTITY],
            scales: vec![Vec3::splat(0.001)],
            opacities: vec![0.5],
            colours: vec![Vec3::ONE],
        };
        let carriers = [u32::try_from(faces.len() - 1).expect("few faces")];
        let carried = Carried::new(&scan, &carriers, &faces, &here);
        for (lifted, expected) in [(0.06, 0.01), (0.03, 0.0), (-0.02, 0.02)] {
            let mut there = here.clone();
            for corner in &mut there[400..] {
                corner.z += lifted;
            }
            let found = growth(&scan, &carried, &carriers, &faces, &seen, &here, &[there]);
            for grown in [found[0].centre, found[0].ends] {
                assert!(
                    (grown - expected).abs() < 3e-3,
                    "{grown} m, lifted by {lifted}"
                );
            }
        }
    }

    #[test]
    fn what_lies_on_the_skin_stays_where_the_skin_bends_from_convex_to_concave() {
        // A strip of large faces, bent up or down along its middle.
        let bent = |rise: f32| -> Vec<Vec3> {
            (0..3_u8)
                .flat_map(|row| {
                    let x = 0.02 * (f32::from(row) - 1.0);
                    [0.0, 0.02].map(|y| Vec3::new(x, y, rise * x.abs()))
                })
                .collect()
        };
        let faces = [[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]];
        let here = bent(-0.5);
        // On the second slope, away from corners and middles.
        let [a, b, c] = [2, 4, 5].map(|v: usize| here[v]);
        let scan = Scan {
            positions: vec![0.45 * a + 0.5 * b + 0.05 * c],
            rotations: vec![Quat::IDENTITY],
            scales: vec![Vec3::splat(0.0001)],
            opacities: vec![0.5],
            colours: vec![Vec3::ONE],
        };
        let carried = Carried::new(&scan, &[2], &faces, &here);
        let found = growth(&scan, &carried, &[2], &faces, &faces, &here, &[bent(0.5)]);
        assert!(found[0].centre < 4e-3, "{} m off the skin", found[0].centre);
    }
}
