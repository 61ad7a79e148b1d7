//! The point of the template's surface under a place, near where something was bound before.

use glam::Vec3;
use spmm3::shares_of_closest;

/// Triangles that are gone over from where the search begins; children are born within a splat of their parent.
const MOST_MOVES: usize = 12;

/// A mesh, and which triangles meet at each vertex.
#[derive(Debug, Clone)]
pub struct Surface<'a> {
    vertices: &'a [Vec3],
    faces: &'a [[u32; 3]],
    /// Triangles of vertex v: `around[starts[v]..starts[v + 1]]`.
    starts: Vec<u32>,
    around: Vec<u32>,
}

/// A point of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Foot {
    /// The triangle it lies on.
    pub triangle: u32,
    /// Weights of its second and third corner.
    pub barycentric: [f32; 2],
    /// Where it is, metres.
    pub point: Vec3,
}

impl<'a> Surface<'a> {
    /// `vertices` (metres) and counter-clockwise triangles of them, whose indices are in range.
    #[must_use]
    pub fn new(vertices: &'a [Vec3], faces: &'a [[u32; 3]]) -> Self {
        let mut starts = vec![0u32; vertices.len() + 1];
        for corner in faces.iter().flatten() {
            starts[*corner as usize + 1] += 1;
        }
        for v in 0..vertices.len() {
            starts[v + 1] += starts[v];
        }
        let mut next = starts.clone();
        let mut around = vec![0u32; 3 * faces.len()];
        for (face, corners) in (0u32..).zip(faces) {
            for corner in corners {
                let place = &mut next[*corner as usize];
                around[*place as usize] = face;
                *place += 1;
            }
        }
        Self {
            vertices,
            faces,
            starts,
            around,
        }
    }

    /// The nearest point to `place` that is reached from `triangle` by always going on to the nearest triangle that shares a vertex: so a
    /// sleeve's Gaussian stays on the sleeve, however near the flank is.
    #[must_use]
    pub fn under(&self, triangle: u32, place: Vec3) -> Foot {
        let mut best = self.foot(triangle, place);
        let mut distance = best.point.distance_squared(place);
        for _ in 0..MOST_MOVES {
            let from = best.triangle;
            for corner in self.faces[from as usize] {
                let (start, end) = (
                    self.starts[corner as usize] as usize,
                    self.starts[corner as usize + 1] as usize,
                );
                for near in &self.around[start..end] {
                    let foot = self.foot(*near, place);
                    let to_foot = foot.point.distance_squared(place);
                    if to_foot < distance {
                        (best, distance) = (foot, to_foot);
                    }
                }
            }
            if best.triangle == from {
                break;
            }
        }
        best
    }

    /// The triangle's corners.
    #[must_use]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.faces[triangle as usize].map(|v| self.vertices[v as usize])
    }

    /// The triangle's nearest point.
    fn foot(&self, triangle: u32, place: Vec3) -> Foot {
        let corners = self.corners(triangle);
        let [_, v, w] = shares_of_closest(place, corners);
        let [a, b, c] = corners;
        Foot {
            triangle,
            barycentric: [v, w],
            point: a + (b - a) * v + (c - a) * w,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use synthetic_person::Random;

    /// A rolled sheet of n x n vertices, 1 m wide.
    fn sheet(n: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let step = 1.0 / (n - 1) as f32;
        let vertices = (0..n * n)
            .map(|i| {
                let (x, y) = ((i % n) as f32 * step, (i / n) as f32 * step);
                Vec3::new(x, y, 0.1 * (4.0 * x).sin())
            })
            .collect();
        let faces = (0..n - 1)
            .flat_map(|y| (0..n - 1).map(move |x| y * n + x))
            .flat_map(|i| [[i, i + 1, i + n], [i + 1, i + n + 1, i + n]])
            .collect();
        (vertices, faces)
    }

    #[test]
    fn the_foot_is_the_nearest_of_all_points_tried_one_by_one() {
        let (vertices, faces) = sheet(9);
        let surface = Surface::new(&vertices, &faces);
        let mut random = Random::new(2);
        for _ in 0..200 {
            let place = Vec3::new(random.unit(), random.unit(), 0.05 * random.signed());
            let count = faces.len();
            let exhaustive = (0u32..)
                .take(count)
                .flat_map(|face| {
                    let [a, b, c] = surface.corners(face);
                    (0..=20u8).flat_map(move |i| {
                        (0..=20 - i).map(move |j| {
                            let (v, w) = (f32::from(i) / 20.0, f32::from(j) / 20.0);
                            a + (b - a) * v + (c - a) * w
                        })
                    })
                })
                .map(|point| point.distance(place))
                .fold(f32::INFINITY, f32::min);
            // From a triangle two columns away.
            let start = (0u32..)
                .take(count)
                .min_by(|a, b| {
                    let far = |face: &u32| {
                        let middle: Vec3 = surface.corners(*face).iter().sum::<Vec3>() / 3.0;
                        middle.distance(place + Vec3::new(0.2, 0.1, 0.0))
                    };
                    far(a).total_cmp(&far(b))
                })
                .expect("triangles");
            let foot = surface.under(start, place);
            let found = foot.point.distance(place);
            assert!(found < exhaustive + 1e-3, "{found}, not {exhaustive}");
            let [v, w] = foot.barycentric;
            assert!(
                v >= 0.0 && w >= 0.0 && v + w <= 1.0 + 1e-5,
                "inside: {v}, {w}"
            );
        }
    }

    #[test]
    fn a_triangle_without_area_has_a_foot_too() {
        let vertices = [Vec3::ZERO, Vec3::ZERO, Vec3::ZERO];
        let faces = [[0, 1, 2]];
        let foot = Surface::new(&vertices, &faces).under(0, Vec3::X);
        assert_eq!(foot.point, Vec3::ZERO, "its only point");
    }
}
