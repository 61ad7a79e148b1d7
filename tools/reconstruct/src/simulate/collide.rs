//! The obstacles of the cloth: a cloud of posed surface points with normals, looked up through a uniform grid.
//!
//! Each point stands for the plane through it. That is exact enough for cloth a few millimetres off a smooth body, and
//! needs no closed mesh: a dressed template has none.

use glam::{IVec3, Vec3};

/// Grid cell and search reach, metres.
const CELL: f32 = 0.05;

/// Posed surface points with unit normals.
#[derive(Debug)]
pub struct Collider {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    low: Vec3,
    size: IVec3,
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl Collider {
    /// Sorts the points into the grid. Points without a normal must have been left out.
    #[must_use]
    pub fn new(points: Vec<Vec3>, normals: Vec<Vec3>) -> Self {
        let low = points
            .iter()
            .copied()
            .fold(Vec3::splat(f32::INFINITY), Vec3::min);
        let high = points
            .iter()
            .copied()
            .fold(Vec3::splat(f32::NEG_INFINITY), Vec3::max);
        let size = if points.is_empty() {
            IVec3::ONE
        } else {
            ((high - low) / CELL)
                .as_ivec3()
                .clamp(IVec3::ZERO, IVec3::splat(255))
                + IVec3::ONE
        };
        let mut collider = Self {
            points,
            normals,
            low,
            size,
            starts: Vec::new(),
            order: Vec::new(),
        };
        let cells = (size.x * size.y * size.z).unsigned_abs() as usize;
        let mut starts = vec![0u32; cells + 1];
        let of: Vec<usize> = collider
            .points
            .iter()
            .map(|p| collider.index(collider.cell(*p)))
            .collect();
        for cell in &of {
            starts[cell + 1] += 1;
        }
        for cell in 0..cells {
            starts[cell + 1] += starts[cell];
        }
        let mut next = starts.clone();
        let mut order = vec![0u32; of.len()];
        for (point, cell) in (0u32..).zip(of) {
            order[next[cell] as usize] = point;
            next[cell] += 1;
        }
        (collider.starts, collider.order) = (starts, order);
        collider
    }

    /// The nearest point within reach (5 cm): its position and normal.
    #[must_use]
    pub fn nearest(&self, at: Vec3) -> Option<(Vec3, Vec3)> {
        if self.points.is_empty() {
            return None;
        }
        let centre = ((at - self.low) / CELL).floor().as_ivec3();
        let from = (centre - IVec3::ONE).max(IVec3::ZERO);
        let to = (centre + IVec3::ONE).min(self.size - IVec3::ONE);
        let mut best = CELL * CELL;
        let mut found = None;
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                for x in from.x..=to.x {
                    let cell = self.index(IVec3::new(x, y, z));
                    let range = self.starts[cell] as usize..self.starts[cell + 1] as usize;
                    for point in &self.order[range] {
                        let distance = self.points[*point as usize].distance_squared(at);
                        if distance < best {
                            best = distance;
                            found = Some(*point as usize);
                        }
                    }
                }
            }
        }
        found.map(|p| (self.points[p], self.normals[p]))
    }

    fn cell(&self, at: Vec3) -> IVec3 {
        ((at - self.low) / CELL)
            .floor()
            .as_ivec3()
            .clamp(IVec3::ZERO, self.size - IVec3::ONE)
    }

    fn index(&self, cell: IVec3) -> usize {
        ((cell.z * self.size.y + cell.y) * self.size.x + cell.x).unsigned_abs() as usize
    }
}

/// A limb as a capsule, posed.
#[derive(Debug, Clone, Copy)]
pub struct Capsule {
    /// One end of the axis, metres.
    pub from: Vec3,
    /// The other end, metres.
    pub to: Vec3,
    /// Radius, metres.
    pub radius: f32,
}

impl Capsule {
    /// How far, and which way, `at` must move to leave the capsule.
    #[must_use]
    pub fn push(&self, at: Vec3) -> Vec3 {
        let axis = self.to - self.from;
        let along = ((at - self.from).dot(axis) / axis.length_squared().max(1e-9)).clamp(0.0, 1.0);
        let away = at - (self.from + axis * along);
        let depth = self.radius - away.length();
        if depth > 0.0 {
            away.normalize_or_zero() * depth
        } else {
            Vec3::ZERO
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_is_the_one_a_full_search_finds() {
        let mut rng = fastrand::Rng::with_seed(1);
        let mut random = || Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 0.6;
        let points: Vec<Vec3> = (0..500).map(|_| random()).collect();
        let collider = Collider::new(points.clone(), vec![Vec3::Y; 500]);
        for _ in 0..300 {
            let at = random() * 1.2 - 0.05;
            let slow = points
                .iter()
                .copied()
                .min_by(|a, b| a.distance(at).total_cmp(&b.distance(at)));
            let expected = slow.filter(|p| p.distance(at) < CELL);
            assert_eq!(collider.nearest(at).map(|f| f.0), expected, "at {at}");
        }
    }
}
