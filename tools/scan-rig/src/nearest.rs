//! The nearest of many points, in as many dimensions as the question has: a k-d tree.
//!
//! Points of a surface are compared with their normals, so that the front of a hand is not taken for the thigh behind it:
//! [`oriented`] joins both to six numbers.

use glam::Vec3;
use std::ops::ControlFlow;

/// Points that a leaf of the tree holds at most.
const LEAF: usize = 12;

/// A position and a unit normal times `weight` metres, as one point of six dimensions.
#[must_use]
pub fn oriented(position: Vec3, normal: Vec3, weight: f32) -> [f32; 6] {
    let [x, y, z] = position.to_array();
    let [u, v, w] = (normal * weight).to_array();
    [x, y, z, u, v, w]
}

/// A point that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Which one, as given to [`Nearest::new`].
    pub at: usize,
    /// Its squared distance.
    pub squared: f32,
}

/// Points in a tree. Of points at one distance the one that was given first is nearer; points that are not finite are never found.
#[derive(Debug, Clone)]
pub struct Nearest<const D: usize> {
    points: Vec<[f32; D]>,
    /// Which point each of `points` was.
    names: Vec<u32>,
    nodes: Vec<Node>,
}

/// A part of the points.
#[derive(Debug, Clone, Copy)]
enum Node {
    Leaf {
        from: u32,
        until: u32,
    },
    Split {
        axis: u8,
        value: f32,
        low: u32,
        high: u32,
    },
}

impl<const D: usize> Nearest<D> {
    /// Builds the tree of at most 2^32 points.
    #[must_use]
    pub fn new(points: &[[f32; D]]) -> Self {
        let mut order: Vec<u32> = (0..u32::try_from(points.len()).unwrap_or(u32::MAX))
            .filter(|at| points[*at as usize].iter().all(|x| x.is_finite()))
            .collect();
        let mut nodes = Vec::new();
        split(points, &mut order, 0, &mut nodes);
        Self {
            points: order.iter().map(|at| points[*at as usize]).collect(),
            names: order,
            nodes,
        }
    }

    /// The nearest point; nothing if there is none, or the query is not finite.
    #[must_use]
    pub fn one(&self, query: &[f32; D]) -> Option<Found> {
        let mut best = [(f32::INFINITY, u32::MAX)];
        let count = self.search(query, &mut best);
        (count == 1).then(|| found(best[0]))
    }

    /// The nearest points, nearest first, as many as fit into `out`; how many there are. The others stay as they were.
    pub fn some(&self, query: &[f32; D], out: &mut [(f32, u32)]) -> usize {
        out.fill((f32::INFINITY, u32::MAX));
        self.search(query, out)
    }

    /// Tells `visit` the squared distance and the name of each point that is nearer than `radius`, in no particular order, until it breaks; none if the query is
    /// not finite.
    pub fn within(
        &self,
        query: &[f32; D],
        radius: f32,
        mut visit: impl FnMut(f32, u32) -> ControlFlow<()>,
    ) {
        let most = radius * radius;
        self.walk(query, most, |squared, name| {
            if squared < most && visit(squared, name).is_break() {
                None
            } else {
                Some(most)
            }
        });
    }

    /// Squared distances and names in `best`, nearest first; how many are filled.
    fn search(&self, query: &[f32; D], best: &mut [(f32, u32)]) -> usize {
        let Some(last) = best.len().checked_sub(1) else {
            return 0;
        };
        let mut count = 0;
        self.walk(query, best[last].0, |squared, name| {
            let candidate = (squared, name);
            if candidate < best[last] {
                let place = best.partition_point(|b| *b < candidate);
                best[place..].rotate_right(1);
                best[place] = candidate;
                count = (count + 1).min(best.len());
            }
            Some(best[last].0)
        });
        count
    }

    /// Tells `visit` squared distances and names, those of all points within the root of `reach` of the query among them, near ones rather first. It says what
    /// `reach` is from then on, or `None` to end. Nothing if the query is not finite.
    fn walk(
        &self,
        query: &[f32; D],
        mut reach: f32,
        mut visit: impl FnMut(f32, u32) -> Option<f32>,
    ) {
        if self.names.is_empty() || query.iter().any(|x| !x.is_finite()) {
            return;
        }
        // A balanced tree of 2^32 points is no deeper than 32; each step leaves one behind.
        let mut stack = [(0_u32, 0.0_f32); 64];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (mut node, least) = stack[height];
            if least > reach {
                continue;
            }
            loop {
                match self.nodes[node as usize] {
                    Node::Leaf { from, until } => {
                        for at in from as usize..until as usize {
                            let squared = squared_distance(query, &self.points[at]);
                            match visit(squared, self.names[at]) {
                                Some(within) => reach = within,
                                None => return,
                            }
                        }
                        break;
                    }
                    Node::Split {
                        axis,
                        value,
                        low,
                        high,
                    } => {
                        let beyond = query[usize::from(axis)] - value;
                        let (near, far) = if beyond < 0.0 {
                            (low, high)
                        } else {
                            (high, low)
                        };
                        // The far side is at least as far as the plane between, and as what it is part of.
                        stack[height] = (far, (beyond * beyond).max(least));
                        height += 1;
                        node = near;
                    }
                }
            }
        }
    }
}

fn squared_distance<const D: usize>(a: &[f32; D], b: &[f32; D]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

fn found((squared, name): (f32, u32)) -> Found {
    Found {
        at: name as usize,
        squared,
    }
}

/// Adds the node of some points, which begin at `from` of all, and the nodes below it.
#[expect(
    clippy::cast_possible_truncation,
    reason = "fewer nodes than points, of which there are at most 2^32; few dimensions"
)]
fn split<const D: usize>(
    points: &[[f32; D]],
    order: &mut [u32],
    from: u32,
    nodes: &mut Vec<Node>,
) -> u32 {
    let name = nodes.len() as u32;
    nodes.push(Node::Leaf {
        from,
        until: from + order.len() as u32,
    });
    if order.len() <= LEAF {
        return name;
    }
    let mut bounds = [(f32::INFINITY, f32::NEG_INFINITY); D];
    for at in &*order {
        for (bound, x) in bounds.iter_mut().zip(points[*at as usize]) {
            *bound = (bound.0.min(x), bound.1.max(x));
        }
    }
    let width = |axis: usize| bounds[axis].1 - bounds[axis].0;
    let axis = (0..D).fold(0, |most, axis| {
        if width(axis) > width(most) {
            axis
        } else {
            most
        }
    });
    if width(axis) <= 0.0 {
        return name;
    }
    let middle = order.len() / 2;
    let by = |at: &u32| points[*at as usize][axis];
    order.select_nth_unstable_by(middle, |a, b| by(a).total_cmp(&by(b)).then(a.cmp(b)));
    let value = by(&order[middle]);
    let (lower, upper) = order.split_at_mut(middle);
    let low = split(points, lower, from, nodes);
    let high = split(points, upper, from + middle as u32, nodes);
    nodes[name as usize] = Node::Split {
        axis: axis as u8,
        value,
        low,
        high,
    };
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_points_are_those_of_a_search_through_all() {
        let mut random = fastrand::Rng::with_seed(3);
        let mut points: Vec<[f32; 6]> = (0..3000)
            .map(|_| std::array::from_fn(|_| (random.f32() * 40.0).floor() / 40.0))
            .collect();
        points.extend_from_within(..50);
        points[7][2] = f32::NAN;
        let tree = Nearest::new(&points);
        for _ in 0..300 {
            let query: [f32; 6] = std::array::from_fn(|_| random.f32() * 1.4 - 0.2);
            let mut all: Vec<(f32, u32)> = (0..)
                .zip(&points)
                .map(|(at, p)| {
                    let squared = p
                        .iter()
                        .zip(&query)
                        .fold(0.0, |s, (a, b)| s + (b - a) * (b - a));
                    (squared, at)
                })
                .filter(|(squared, _)| squared.is_finite())
                .collect();
            all.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
            let mut some = [(0.0, 0); 9];
            assert_eq!(tree.some(&query, &mut some), 9, "too few");
            assert_eq!(some[..], all[..9], "not the nearest of {query:?}");
            let one = tree.one(&query).map(|f| f.at);
            assert_eq!(one, Some(all[0].1 as usize), "not the nearest one");
            let radius = all[40].0.sqrt();
            let mut within = Vec::new();
            tree.within(&query, radius, |squared, at| {
                within.push((squared, at));
                ControlFlow::Continue(())
            });
            within.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
            let near = all.iter().filter(|(squared, _)| *squared < radius * radius);
            assert_eq!(within, near.copied().collect::<Vec<_>>(), "within {radius}");
        }
    }

    #[test]
    fn no_points_or_no_number_find_nothing() {
        assert!(Nearest::<3>::new(&[]).one(&[0.0; 3]).is_none(), "of none");
        let tree = Nearest::new(&[[1.0, 2.0, 3.0]; 100]);
        assert!(tree.one(&[f32::NAN; 3]).is_none(), "near no number");
        tree.within(&[f32::NAN; 3], 9.0, |_, _| panic!("near no number"));
        assert_eq!(tree.one(&[0.0; 3]).map(|f| f.at), Some(0), "of equals");
    }
}
