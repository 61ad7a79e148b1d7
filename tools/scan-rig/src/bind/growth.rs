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
        let mut normals = vec![Vec3::ZERO; vertices.len()];
        let mut outwards = Vec::with_capacity(points.len());
        for face in seen {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            let normal = (b - a).cross(c - a);
            outwards.push(normal);
            face.iter().for_each(|v| normals[*v as usize] += normal);
        }
        outwards.extend(corners.iter().map(|v| normals[*v as usize]));
        let tree = Nearest::new(&points);
        let distance = |point: Vec3| {
            let found = tree.one(&point.to_array());
            found.map_or(f32::INFINITY, |found| {
                let apart = point - Vec3::from(points[found.at]);
                found.squared.sqrt().copysign(apart.dot(outwards[found.at]))
            })
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
        // What comes out of the body leaves it as well, however deep it was.
        let grown =
            |before: f32, after: f32| (after.abs() - before.abs()).max(after - before.max(0.0));
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
    fn what_comes_out_of_the_body_leaves_it_and_what_stays_inside_does_not() {
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
        for (lifted, expected) in [(0.06, 0.01), (0.03, -0.02), (-0.02, 0.02)] {
            let mut there = here.clone();
            for corner in &mut there[400..] {
                corner.z += lifted;
            }
            let found = growth(&scan, &carried, &carriers, &faces, &seen, &here, &[there]);
            let (centre, expected) = (found[0].centre, f32::max(expected, 0.0));
            assert!(
                (centre - expected).abs() < 2e-3,
                "{centre} m, lifted by {lifted}"
            );
        }
    }
}
