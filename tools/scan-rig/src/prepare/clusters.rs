//! Points that hang together, found in a grid of cells.

use glam::{IVec3, Vec3};
use std::collections::HashMap;

/// Cells this far apart still hang together.
const REACH: i32 = 2;

/// Cells that hang together.
#[derive(Debug, Clone)]
pub struct Cluster {
    /// Sorted.
    cells: Vec<[i32; 3]>,
    cell: f32,
}

impl Cluster {
    /// How many cells it has.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.cells.len()
    }

    /// Opposite corners of its box.
    #[must_use]
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let none = (IVec3::MAX, IVec3::MIN);
        let (low, high) = self.cells.iter().fold(none, |(low, high), cell| {
            let cell = IVec3::from_array(*cell);
            (low.min(cell), high.max(cell))
        });
        (
            low.as_vec3() * self.cell,
            (high.as_vec3() + 1.0) * self.cell,
        )
    }

    /// Whether a point lies in one of its cells or a neighbour of one.
    #[must_use]
    pub fn has_near(&self, point: Vec3) -> bool {
        let at = place(point, self.cell);
        (-1..=1).any(|x| {
            (-1..=1).any(|y| {
                // Neighbours along z follow each other in the list.
                let low = [at[0] + x, at[1] + y, at[2] - 1];
                let first = self.cells.partition_point(|cell| *cell < low);
                (self.cells.get(first)).is_some_and(|cell| *cell <= [low[0], low[1], at[2] + 1])
            })
        })
    }
}

#[expect(clippy::cast_possible_truncation, reason = "casts saturate")]
fn place(point: Vec3, cell: f32) -> [i32; 3] {
    (point / cell)
        .floor()
        .to_array()
        .map(|at| (at as i32).clamp(-1 << 28, 1 << 28))
}

/// The clusters of points, those with most cells first. `cell` is the side of a cell. Cells with a single point among many are
/// strays and join nothing.
#[must_use]
pub fn clusters(points: &[Vec3], cell: f32) -> Vec<Cluster> {
    let mut counts: HashMap<[i32; 3], usize> = HashMap::new();
    for point in points {
        *counts.entry(place(*point, cell)).or_default() += 1;
    }
    let least = if points.len() > 50_000 { 2 } else { 1 };
    let mut cells: Vec<[i32; 3]> = (counts.iter().filter(|(_, count)| **count >= least))
        .map(|(at, _)| *at)
        .collect();
    cells.sort_unstable();
    let index: HashMap<[i32; 3], usize> = cells
        .iter()
        .enumerate()
        .map(|(index, at)| (*at, index))
        .collect();
    let mut taken = vec![false; cells.len()];
    let mut found = Vec::new();
    for start in 0..cells.len() {
        if std::mem::replace(&mut taken[start], true) {
            continue;
        }
        let (mut members, mut open) = (Vec::new(), vec![start]);
        while let Some(at) = open.pop() {
            let here = cells[at];
            members.push(here);
            for x in -REACH..=REACH {
                for y in -REACH..=REACH {
                    for z in -REACH..=REACH {
                        let there = [here[0] + x, here[1] + y, here[2] + z];
                        if let Some(next) = index.get(&there)
                            && !std::mem::replace(&mut taken[*next], true)
                        {
                            open.push(*next);
                        }
                    }
                }
            }
        }
        members.sort_unstable();
        found.push(Cluster {
            cells: members,
            cell,
        });
    }
    // The sort is stable: equal ones keep the order of their cells.
    found.sort_by_key(|cluster| std::cmp::Reverse(cluster.cells()));
    found
}
