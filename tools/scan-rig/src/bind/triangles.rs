//! Which triangle of the body each Gaussian is on.

use super::carried::nearest_point;
use crate::body::SkinRow;
use crate::nearest::{Nearest, oriented};
use glam::Vec3;
use rayon::prelude::*;
use spmm3::{JOINTS, Joint};

/// Metres that normals at right angles are worth, divided by the root of two: for a Gaussian on the mesh, and for Gaussians beside each
/// other.
const ON_MESH: f32 = 0.08;
const BESIDE: f32 = 0.03;
/// A face whose normal fits, or of the part of the body that neighbours are on, may be so much farther than the nearest, metres. What is deep under the
/// chin has the collar's normal: by normals alone it would hang on the collar, and come out of the throat when a shoulder is lifted.
const FARTHER: f32 = 0.03;
/// Faces whose middles are nearest that are compared.
const TRIED: usize = 16;
/// What their normals count then, as a share of [`ON_MESH`] squared: all are on one side of the body, and the surface's normals have noise.
const AMONG_TRIED: f32 = 0.06;
/// Neighbours that are asked for their part of the body, and how often.
const ASKED: usize = 24;
const ROUNDS: usize = 3;

/// The faces that Gaussians may be on, in the scan's pose.
#[derive(Debug)]
pub(super) struct Faces {
    /// Which face each of the following is.
    names: Vec<u32>,
    points: Vec<[f32; 6]>,
    corners: Vec<[Vec3; 3]>,
    /// The part of the body of each.
    parts: Vec<u8>,
    tree: Nearest<6>,
    /// Their middles.
    middles: Nearest<3>,
}

impl Faces {
    /// Takes the faces for which `outer` is true. `weights` has the weight of every joint for each vertex.
    #[must_use]
    pub(super) fn new(
        vertices: &[Vec3],
        faces: &[[u32; 3]],
        weights: &[SkinRow],
        outer: impl Fn(usize) -> bool,
    ) -> Self {
        let mut names = Vec::new();
        let mut points = Vec::new();
        let mut corners = Vec::new();
        let mut parts = Vec::new();
        for (name, face) in (0_u32..).zip(faces) {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            let Some(normal) = (b - a).cross(c - a).try_normalize() else {
                continue;
            };
            if outer(name as usize) {
                names.push(name);
                points.push(oriented((a + b + c) / 3.0, normal, ON_MESH));
                corners.push([a, b, c]);
                parts.push(part_of(face, weights));
            }
        }
        let tree = Nearest::new(&points);
        let middle = |corners: &[Vec3; 3]| (corners.iter().sum::<Vec3>() / 3.0).to_array();
        let middles = Nearest::new(&corners.iter().map(middle).collect::<Vec<_>>());
        Self {
            names,
            points,
            corners,
            parts,
            tree,
            middles,
        }
    }

    /// The nearest face to a place with this normal.
    #[must_use]
    pub(super) fn nearest(&self, position: Vec3, normal: Vec3) -> Option<u32> {
        Some(self.names[self.best(position, normal)?])
    }

    /// The face that fits a place with this normal best, and the one whose middle is nearest where that is much farther.
    fn best(&self, position: Vec3, normal: Vec3) -> Option<usize> {
        let best = self.in_tree(&self.tree, |at| at, position, normal)?;
        let nearest = self.middles.one(&position.to_array())?.at;
        let is_far = self.distance(position, best) > self.distance(position, nearest) + FARTHER;
        Some(if is_far { nearest } else { best })
    }

    fn distance(&self, position: Vec3, at: usize) -> f32 {
        nearest_point(position, self.corners[at]).distance(position)
    }

    /// Of the faces in a tree whose middles are nearest, the one that is nearest itself; `name` says which face a point of the tree is.
    fn in_tree(
        &self,
        tree: &Nearest<6>,
        name: impl Fn(usize) -> usize,
        position: Vec3,
        normal: Vec3,
    ) -> Option<usize> {
        let query = oriented(position, normal, ON_MESH);
        let mut found = [(0.0, 0); TRIED];
        let count = tree.some(&query, &mut found);
        let mut best: Option<(f32, usize)> = None;
        for (squared, at) in &found[..count] {
            let at = name(*at as usize);
            let corners = self.corners[at];
            let nearest = nearest_point(position, corners);
            let middle = corners.iter().sum::<Vec3>() / 3.0;
            let turned = squared - middle.distance_squared(position);
            let squared = nearest.distance_squared(position) + turned * AMONG_TRIED;
            if best.is_none_or(|(least, _)| squared < least) {
                best = Some((squared, at));
            }
        }
        best.map(|(_, at)| at)
    }

    /// For each Gaussian (its position, and the normal of the surface there) a face, and how many were moved to another part of the body
    /// because their neighbours are on it. Nothing if no face may be taken.
    #[must_use]
    pub(super) fn choose(&self, positions: &[Vec3], normals: &[Vec3]) -> Option<(Vec<u32>, usize)> {
        let mut chosen: Vec<usize> = (0..positions.len())
            .into_par_iter()
            .map(|at| self.best(positions[at], normals[at]))
            .collect::<Option<_>>()?;
        let parts: Vec<u8> = chosen.iter().map(|at| self.parts[*at]).collect();
        let voted = vote(positions, normals, parts.clone());
        // Those outvoted take the nearest face of the part that won.
        let mut moved = 0;
        for part in 0..JOINTS {
            let outvoted: Vec<usize> = (0..positions.len())
                .filter(|at| voted[*at] != parts[*at] && usize::from(voted[*at]) == part)
                .collect();
            if outvoted.is_empty() {
                continue;
            }
            let members: Vec<usize> = (0..self.names.len())
                .filter(|at| usize::from(self.parts[*at]) == part)
                .collect();
            let points: Vec<_> = members.iter().map(|at| self.points[*at]).collect();
            let tree = Nearest::new(&points);
            for at in outvoted {
                let found = self.in_tree(&tree, |at| members[at], positions[at], normals[at]);
                let most = self.distance(positions[at], chosen[at]) + FARTHER;
                let is_near = |face: &usize| self.distance(positions[at], *face) <= most;
                if let Some(face) = found.filter(is_near) {
                    chosen[at] = face;
                    moved += 1;
                }
            }
        }
        Some((chosen.into_iter().map(|at| self.names[at]).collect(), moved))
    }
}

/// The part of the body that most of the nearest Gaussians are on.
fn vote(positions: &[Vec3], normals: &[Vec3], mut parts: Vec<u8>) -> Vec<u8> {
    let points: Vec<_> = positions
        .iter()
        .zip(normals)
        .map(|(p, n)| oriented(*p, *n, BESIDE))
        .collect();
    let tree = Nearest::new(&points);
    let asked: Vec<[u32; ASKED]> = points
        .par_iter()
        .map(|point| {
            let mut found = [(0.0, 0); ASKED];
            let count = tree.some(point, &mut found);
            let last = found[count.saturating_sub(1)].1;
            std::array::from_fn(|at| if at < count { found[at].1 } else { last })
        })
        .collect();
    for _ in 0..ROUNDS {
        parts = asked
            .par_iter()
            .map(|asked| {
                let mut votes = [0_u8; JOINTS];
                for other in asked {
                    votes[usize::from(parts[*other as usize])] += 1;
                }
                let most = (0..JOINTS).fold(0, |most, part| {
                    if votes[part] > votes[most] {
                        part
                    } else {
                        most
                    }
                });
                #[expect(clippy::cast_possible_truncation, reason = "fewer than 55")]
                let most = most as u8;
                most
            })
            .collect();
    }
    parts
}

/// The part of the body of a face: the joint that moves it the most, joints between which no border is worth a vote taken together.
fn part_of(face: &[u32; 3], weights: &[SkinRow]) -> u8 {
    let sum = |joint: usize| -> f32 { face.iter().map(|v| weights[*v as usize][joint]).sum() };
    let most = (0..JOINTS).fold(
        0,
        |most, joint| if sum(joint) > sum(most) { joint } else { most },
    );
    let joint = Joint::ALL.get(most).copied().unwrap_or(Joint::Pelvis);
    whole(joint) as u8
}

/// Trunk, head, arms, upper legs' and lower legs' parts, feet; fingers one by one.
fn whole(joint: Joint) -> Joint {
    match joint {
        Joint::Spine1
        | Joint::Spine2
        | Joint::Spine3
        | Joint::LeftCollar
        | Joint::RightCollar
        | Joint::LeftHip
        | Joint::RightHip => Joint::Pelvis,
        Joint::Neck | Joint::Jaw | Joint::LeftEye | Joint::RightEye => Joint::Head,
        Joint::LeftFoot => Joint::LeftAnkle,
        Joint::RightFoot => Joint::RightAnkle,
        Joint::LeftElbow | Joint::LeftWrist => Joint::LeftShoulder,
        Joint::RightElbow | Joint::RightWrist => Joint::RightShoulder,
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of 4 x 4 quads.
    fn square(corner: Vec3, u: Vec3, v: Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        for at in 0..25_u16 {
            let (i, j) = (f32::from(at % 5), f32::from(at / 5));
            vertices.push(corner + u * (i / 4.0) + v * (j / 4.0));
            if at % 5 < 4 && at / 5 < 4 {
                let at = u32::from(at);
                faces.extend([[at, at + 1, at + 6], [at, at + 6, at + 5]]);
            }
        }
        (vertices, faces)
    }

    #[test]
    fn a_face_whose_normal_fits_is_not_taken_from_far_away() {
        let side = 0.02;
        // More faces than are compared face +x, beside some that face +z.
        for (x, is_aside) in [(0.1, false), (0.03, true)] {
            let (mut vertices, mut faces) =
                square(Vec3::new(-0.01, -0.01, 0.0), Vec3::X * side, Vec3::Y * side);
            let (own, of_first) = (vertices.len(), faces.len());
            let (others, far) = square(Vec3::new(x, -0.01, -0.02), Vec3::Y * side, Vec3::Z * side);
            vertices.extend(others);
            let first = u32::try_from(own).expect("few");
            faces.extend(far.iter().map(|face| face.map(|v| v + first)));
            let mut row = [0.0; JOINTS];
            row[0] = 1.0;
            let faces = Faces::new(&vertices, &faces, &vec![row; vertices.len()], |_| true);
            let found = faces.nearest(Vec3::new(0.002, -0.004, -0.01), Vec3::X);
            let found = found.map(|found| found as usize >= of_first);
            assert_eq!(found, Some(is_aside), "beside faces {x} m away");
        }
    }
}
