//! What is worn or carried and is no body: a helmet in a hand, a bag, a hat. It is found as a cluster off the body, and moves with one
//! joint.

use crate::body::SkinRow;
use crate::body::state::is_above;
use glam::{IVec3, Vec3};
use rayon::prelude::*;
use serde::{Serialize, Serializer};
use spmm3::{JOINTS, Joint};
use std::collections::BTreeMap;

/// What is farther from the body is not body, metres.
pub const OFF_BODY: f32 = 0.045;
/// Side of the cells whose neighbours are one thing, metres.
const CELL: f32 = 0.03;
/// Gaussians that a thing has at least.
const LEAST: usize = 600;
/// A cell with so many times fewer points than the median cell of its cluster has strays alone.
const EMPTY: usize = 4;
/// The most things.
const MOST: usize = 5;
/// How far a thing reaches beyond its Gaussians that are off the body, metres.
const GROWN: f32 = 0.025;
/// Weight, in vertices, of a hand in a thing from which on the hand holds it.
const HELD: f32 = 5.0;
/// What is larger than this is not held in a hand unless it is thin, metres.
const HELD_SIZE: f32 = 0.75;
/// Directions that bound a thing.
const DIRECTIONS: usize = 240;

/// A thing that is no body.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Accessory {
    /// The joint that it moves with.
    #[serde(serialize_with = "by_name")]
    pub joint: Joint,
    /// Its Gaussians in the scan.
    pub gaussians: usize,
    /// The middle of its part off the body, metres.
    pub centre: [f32; 3],
    /// The diagonal of the box around that part, metres.
    pub size: f32,
}

fn by_name<S: Serializer>(joint: &Joint, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(joint.name())
}

/// The convex shape around points, bounded by planes in fixed directions.
#[derive(Debug, Clone)]
pub struct Shape {
    bounds: Vec<(Vec3, f32)>,
}

impl Shape {
    /// Around points, `grown` metres farther.
    fn around(points: &[Vec3], grown: f32) -> Self {
        let bounds = directions()
            .map(|direction| {
                let most = points
                    .iter()
                    .map(|p| p.dot(direction))
                    .fold(f32::NEG_INFINITY, f32::max);
                (direction, most + grown)
            })
            .collect();
        Self { bounds }
    }

    /// Whether a point is inside.
    #[must_use]
    pub fn contains(&self, point: Vec3) -> bool {
        self.bounds.iter().all(|(d, most)| point.dot(*d) <= *most)
    }
}

/// Directions spread evenly over the sphere (Fibonacci's lattice).
fn directions() -> impl Iterator<Item = Vec3> {
    let golden = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    (0..DIRECTIONS).map(move |at| {
        let y = 1.0 - (at as f32 + 0.5) * 2.0 / DIRECTIONS as f32;
        let radius = (1.0 - y * y).sqrt();
        let (sin, cos) = (golden * at as f32).sin_cos();
        Vec3::new(radius * cos, y, radius * sin)
    })
}

/// The clusters of points, largest first: cells of a grid that touch, with at least as many points as a thing has. Cells that are much emptier
/// than a cluster's others belong to none: a handful of strays, trousers that stand 45 mm off the model for once, would link two things,
/// and a hull that reaches to them takes in what lies between.
#[must_use]
pub fn clusters(points: &[Vec3]) -> Vec<Vec<Vec3>> {
    let mut cells = Cells::new();
    for point in points.iter().filter(|p| p.is_finite()) {
        let cell = (*point / CELL).floor().as_ivec3();
        cells.entry(cell.to_array()).or_default().push(*point);
    }
    let mut found: Vec<Vec<Vec3>> = touching(cells)
        .into_iter()
        .flat_map(|mut cluster| {
            let least = usual(&cluster) / EMPTY;
            cluster.retain(|_, members| members.len() >= least);
            touching(cluster)
        })
        .map(|cluster| cluster.into_values().flatten().collect())
        .collect();
    found.sort_by_key(|members| std::cmp::Reverse(members.len()));
    found.truncate(MOST);
    found
}

/// Points by the cell of the grid that they are in.
type Cells = BTreeMap<[i32; 3], Vec<Vec3>>;

/// How many points the median cell has.
fn usual(cells: &Cells) -> usize {
    let mut counts: Vec<usize> = cells.values().map(Vec::len).collect();
    counts.sort_unstable();
    counts.get(counts.len() / 2).copied().unwrap_or_default()
}

/// The cells in groups that touch, those with too few points for a thing left out.
fn touching(mut cells: Cells) -> Vec<Cells> {
    let mut groups = Vec::new();
    while let Some(first) = cells.pop_first() {
        let mut group = Cells::new();
        let mut open = vec![first];
        while let Some((cell, members)) = open.pop() {
            for at in 0..27 {
                let step = IVec3::new(at % 3, at / 3 % 3, at / 9) - 1;
                let beside = (IVec3::from(cell) + step).to_array();
                open.extend(cells.remove_entry(&beside));
            }
            group.insert(cell, members);
        }
        if group.values().map(Vec::len).sum::<usize>() >= LEAST {
            groups.push(group);
        }
    }
    groups
}

/// The body as things see it: its vertices, and the weight of every joint for each.
#[derive(Debug, Clone, Copy)]
pub struct Wearer<'a> {
    /// Vertices in the scan's pose, metres.
    pub vertices: &'a [Vec3],
    /// Weight of every joint, before fingers were given to wrists.
    pub weights: &'a [SkinRow],
}

/// The shape of a cluster, and the joint that it moves with.
#[must_use]
pub fn attach(cluster: &[Vec3], wearer: Wearer<'_>) -> (Shape, Accessory) {
    let shape = Shape::around(cluster, GROWN);
    let low = cluster.iter().fold(Vec3::INFINITY, |a, b| a.min(*b));
    let high = cluster.iter().fold(Vec3::NEG_INFINITY, |a, b| a.max(*b));
    let centre = cluster.iter().sum::<Vec3>() / cluster.len().max(1) as f32;
    let size = (high - low).length();
    let mut score = [0.0_f32; JOINTS];
    for (vertex, weights) in wearer.vertices.iter().zip(wearer.weights) {
        if shape.contains(*vertex) {
            for (sum, weight) in score.iter_mut().zip(weights) {
                *sum += weight;
            }
        }
    }
    let joint = held_by(&score, size)
        .or_else(|| most(&score))
        .unwrap_or_else(|| nearest_joint(cluster, wearer));
    let accessory = Accessory {
        joint,
        gaussians: 0,
        centre: centre.to_array(),
        size,
    };
    (shape, accessory)
}

/// The wrist of the hand that reaches into a thing of that size.
fn held_by(score: &[f32; JOINTS], size: f32) -> Option<Joint> {
    let hand = |wrist: Joint| -> f32 {
        let below = Joint::ALL.into_iter().filter(|j| is_above(wrist, *j));
        below.map(|joint| score[joint as usize]).sum()
    };
    let (left, right) = (hand(Joint::LeftWrist), hand(Joint::RightWrist));
    let wrist = if left > right {
        Joint::LeftWrist
    } else {
        Joint::RightWrist
    };
    (left.max(right) >= HELD && size < HELD_SIZE).then_some(wrist)
}

/// The joint with the largest score; of the head's and the fingers' joints the one that carries them.
fn most(score: &[f32; JOINTS]) -> Option<Joint> {
    let best = Joint::ALL
        .into_iter()
        .max_by(|a, b| score[*a as usize].total_cmp(&score[*b as usize]))?;
    (score[best as usize] > 0.0).then(|| carrier(best))
}

/// The nearest of a joint and those above it that things hang on.
fn carrier(joint: Joint) -> Joint {
    for whole in [
        Joint::Head,
        Joint::LeftWrist,
        Joint::RightWrist,
        Joint::LeftAnkle,
        Joint::RightAnkle,
    ] {
        if is_above(whole, joint) {
            return whole;
        }
    }
    joint
}

/// The joint that moves the vertex nearest to any of the points the most.
fn nearest_joint(cluster: &[Vec3], wearer: Wearer<'_>) -> Joint {
    let nearest = wearer
        .vertices
        .par_iter()
        .zip(wearer.weights)
        .map(|(vertex, weights)| {
            let squared = cluster
                .iter()
                .map(|p| p.distance_squared(*vertex))
                .fold(f32::INFINITY, f32::min);
            (squared, weights)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0));
    nearest
        .and_then(|(_, weights)| most(weights))
        .unwrap_or(Joint::Pelvis)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strays_beside_a_thing_neither_widen_it_nor_link_it_to_another() {
        let shell = |centre: Vec3| {
            (0..40).flat_map(move |turn| {
                let turn = glam::Quat::from_rotation_y(turn as f32);
                directions().map(move |d| centre + turn * d * 0.12)
            })
        };
        let (left, right) = (Vec3::ZERO, Vec3::X * 0.5);
        let mut points: Vec<Vec3> = shell(left).chain(shell(right)).collect();
        let between: Vec<Vec3> = (0..60)
            .map(|at| Vec3::X * (0.13 + 0.004 * at as f32))
            .collect();
        points.extend(&between);
        let found = clusters(&points);
        assert_eq!(found.len(), 2, "two things");
        for thing in &found {
            let hull = Shape::around(thing, GROWN);
            assert!(!hull.contains(Vec3::X * 0.25), "what lies between them");
            let centre = if hull.contains(left) { left } else { right };
            let whole = shell(centre).all(|point| hull.contains(point));
            assert!(whole, "all of it");
        }
    }
}
