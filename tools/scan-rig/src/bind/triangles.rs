//! Which triangle of the body each Gaussian is on.

use crate::body::SkinRow;
use crate::nearest::{Nearest, oriented};
use glam::Vec3;
use rayon::prelude::*;
use spmm3::{JOINTS, Joint};

/// Metres that normals at right angles are worth, divided by the root of two: for a Gaussian on the mesh, and for Gaussians beside each
/// other.
const ON_MESH: f32 = 0.08;
const BESIDE: f32 = 0.03;
/// Neighbours that are asked for their part of the body, and how often.
const ASKED: usize = 24;
const ROUNDS: usize = 3;

/// The faces that Gaussians may be on, in the scan's pose.
#[derive(Debug)]
pub struct Faces {
    /// Which face each of the following is.
    names: Vec<u32>,
    points: Vec<[f32; 6]>,
    /// The part of the body of each.
    parts: Vec<u8>,
    tree: Nearest<6>,
}

impl Faces {
    /// Takes the faces for which `outer` is true. `weights` has the weight of every joint for each vertex.
    #[must_use]
    pub fn new(
        vertices: &[Vec3],
        faces: &[[u32; 3]],
        weights: &[SkinRow],
        outer: impl Fn(usize) -> bool,
    ) -> Self {
        let mut names = Vec::new();
        let mut points = Vec::new();
        let mut parts = Vec::new();
        for (name, face) in (0_u32..).zip(faces) {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            let Some(normal) = (b - a).cross(c - a).try_normalize() else {
                continue;
            };
            if outer(name as usize) {
                names.push(name);
                points.push(oriented((a + b + c) / 3.0, normal, ON_MESH));
                parts.push(part_of(face, weights));
            }
        }
        let tree = Nearest::new(&points);
        Self {
            names,
            points,
            parts,
            tree,
        }
    }

    /// For each Gaussian (its position, and the normal of the surface there) a face, and how many were moved to another part of the body
    /// because their neighbours are on it. Nothing if no face may be taken.
    #[must_use]
    pub fn choose(&self, positions: &[Vec3], normals: &[Vec3]) -> Option<(Vec<u32>, usize)> {
        let query = |at: usize| oriented(positions[at], normals[at], ON_MESH);
        let mut chosen: Vec<usize> = (0..positions.len())
            .into_par_iter()
            .map(|at| self.tree.one(&query(at)).map(|found| found.at))
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
                if let Some(found) = tree.one(&query(at)) {
                    chosen[at] = members[found.at];
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
