//! The closest point on a triangle mesh, through a tree of bounding boxes over its triangles.

use glam::Vec3;
use spmm3::shares_of_closest;
use std::ops::Range;

/// Triangles that a leaf of the tree holds at most.
const LEAF: usize = 4;

/// A mesh prepared for closest-point queries.
pub(super) struct ClosestPoint {
    triangles: Vec<[Vec3; 3]>,
    /// Triangles in the tree's order.
    order: Vec<usize>,
    nodes: Vec<Node>,
}

/// A box around some triangles; the root comes first.
struct Node {
    low: Vec3,
    high: Vec3,
    /// Place in the order.
    range: Range<usize>,
    children: Option<[usize; 2]>,
}

/// A point on the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    /// Triangle, as given.
    pub(super) triangle: usize,
    /// Shares of its corners, which sum to 1.
    pub(super) shares: [f32; 3],
    /// Distance from the query point, in the mesh's unit.
    pub(super) distance: f32,
}

impl ClosestPoint {
    /// Builds the tree.
    pub(super) fn new(triangles: Vec<[Vec3; 3]>) -> Self {
        let order = (0..triangles.len()).collect();
        let mut tree = Self {
            triangles,
            order,
            nodes: Vec::new(),
        };
        if !tree.triangles.is_empty() {
            tree.split(0..tree.triangles.len());
        }
        tree
    }

    /// Adds the node of a range and those below it, halving at the median along the longest axis.
    fn split(&mut self, range: Range<usize>) -> usize {
        let corners = || {
            self.order[range.clone()]
                .iter()
                .flat_map(|t| self.triangles[*t])
        };
        let low = corners().fold(Vec3::INFINITY, Vec3::min);
        let high = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
        let index = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            range: range.clone(),
            children: None,
        });
        if range.len() > LEAF {
            let axis = (high - low).max_position();
            let triangles = &self.triangles;
            let centre = |t: usize| triangles[t].iter().map(|p| p[axis]).sum::<f32>();
            self.order[range.clone()]
                .sort_unstable_by(|a, b| centre(*a).total_cmp(&centre(*b)).then(a.cmp(b)));
            let middle = range.start + range.len() / 2;
            let first = self.split(range.start..middle);
            let second = self.split(middle..range.end);
            self.nodes[index].children = Some([first, second]);
        }
        index
    }

    /// The closest point; of equally close ones that of the first triangle. `None` if there are no triangles.
    pub(super) fn find(&self, at: Vec3) -> Option<Found> {
        let mut best: Option<Found> = None;
        let mut open = vec![0];
        while let Some(node) = open.pop().and_then(|index| self.nodes.get(index)) {
            let reach = best.map_or(f32::INFINITY, |found| found.distance);
            if node.distance(at) > reach {
                continue;
            }
            if let Some([first, second]) = node.children {
                // The nearer box is looked into first.
                let swap = self.nodes[first].distance(at) < self.nodes[second].distance(at);
                open.extend(if swap {
                    [second, first]
                } else {
                    [first, second]
                });
                continue;
            }
            for triangle in &self.order[node.range.clone()] {
                let corners = self.triangles[*triangle];
                let shares = shares_of_closest(at, corners);
                let point: Vec3 = corners.iter().zip(shares).map(|(c, s)| *c * s).sum();
                let distance = point.distance(at);
                let closer = best.is_none_or(|b| (distance, *triangle) < (b.distance, b.triangle));
                if closer && distance.is_finite() {
                    best = Some(Found {
                        triangle: *triangle,
                        shares,
                        distance,
                    });
                }
            }
        }
        best
    }
}

impl Node {
    fn distance(&self, at: Vec3) -> f32 {
        at.clamp(self.low, self.high).distance(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_point_beats_every_sample_of_the_mesh() {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut random = || Vec3::new(rng.f32(), rng.f32(), rng.f32());
        let triangles: Vec<[Vec3; 3]> = (0..200)
            .map(|_| {
                let centre = random();
                [0; 3].map(|_| centre + 0.2 * random())
            })
            .collect();
        let mesh = ClosestPoint::new(triangles.clone());
        for _ in 0..50 {
            let at = 2.0 * random() - Vec3::splat(0.5);
            let found = mesh.find(at).expect("there are triangles");
            let [a, b, c] = triangles[found.triangle];
            let [u, v, w] = found.shares;
            assert!(u.min(v).min(w) >= -1e-5, "{u} {v} {w} lie off the triangle");
            assert!(
                (u + v + w - 1.0).abs() < 1e-5,
                "{u} {v} {w} do not sum to 1"
            );
            let off = (a * u + b * v + c * w).distance(at) - found.distance;
            assert!(off.abs() < 1e-6, "the distance is another point's");
            // A grid of samples on every triangle: none is closer, the best is nearly as close.
            let mut sampled = f32::INFINITY;
            for [a, b, c] in &triangles {
                for i in 0..=20u8 {
                    for j in 0..=20 - i {
                        let (v, w) = (f32::from(i) / 20.0, f32::from(j) / 20.0);
                        let point = *a + (*b - *a) * v + (*c - *a) * w;
                        sampled = sampled.min(point.distance(at));
                    }
                }
            }
            let late = sampled - found.distance;
            assert!(
                (-1e-5..0.01).contains(&late),
                "sampled {sampled}, {found:?}"
            );
        }
        assert_eq!(
            ClosestPoint::new(Vec::new()).find(Vec3::ZERO),
            None,
            "empty"
        );
    }
}
