//! L_bind: Gaussians that leave the surface.

use crate::error::{ModelError, check_count};
use crate::planes::{RUN, planes, planes_mut};
use glam::Vec3;
use rayon::prelude::*;
use splat_gradient::Attributes;
use spmm3::{ATTRIBUTES, BoundGaussians, Template, shares_of_closest};

/// Gaussians whose nearest points one task seeks.
const PIECE: usize = 256;

/// The surface near each Gaussian.
///
/// The nearest point is sought on the Gaussian's own triangle and on all that share a corner with it. A Gaussian that strayed further is
/// drawn back to this neighbourhood, which is what the term is for: the nearest point of the whole mesh could be another limb's.
#[derive(Debug, Clone)]
pub struct Surface {
    faces: Vec<[u32; 3]>,
    /// Of every Gaussian.
    triangles: Vec<u32>,
    /// Triangles that share a corner with triangle t, itself left out: `around[starts[t]..starts[t + 1]]`.
    starts: Vec<u32>,
    around: Vec<u32>,
    vertices: usize,
    spheres: Vec<Sphere>,
    found: Vec<Nearest>,
}

/// Which Gaussians are looked at: number `first`, and from there on one of `every`.
///
/// The search for nearest points costs as much as drawing does. Where each step takes a share of the Gaussians in turn, with a weight as many times
/// as large, every Gaussian is looked at as often as the others, and none in an order that depends on the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    /// Index of the first one.
    pub first: usize,
    /// From one to the next; 0 counts as 1.
    pub every: usize,
}

impl Share {
    /// All of them.
    pub const ALL: Self = Self { first: 0, every: 1 };

    /// The share of a step: over any `every` steps that follow each other, each Gaussian is looked at once.
    #[must_use]
    pub fn of_step(step: u64, every: u8) -> Self {
        let every = every.max(1);
        Self {
            first: usize::try_from(step % u64::from(every)).unwrap_or(0),
            every: usize::from(every),
        }
    }

    /// How many of `count` Gaussians it has.
    fn len(self, count: usize) -> usize {
        count.saturating_sub(self.first).div_ceil(self.every.max(1))
    }

    /// The index of the one at `slot`.
    fn index(self, slot: usize) -> usize {
        self.first + slot * self.every.max(1)
    }
}

/// Around a triangle: what is farther from it is farther from the triangle.
#[derive(Debug, Clone, Copy, Default)]
struct Sphere {
    centre: Vec3,
    radius: f32,
}

/// A Gaussian's nearest point of the surface.
#[derive(Debug, Clone, Copy, Default)]
struct Nearest {
    corners: [u32; 3],
    weights: [f32; 3],
    /// From the point to the Gaussian, metres.
    away: Vec3,
}

impl Surface {
    /// Of a template and the triangles that Gaussians are bound to.
    ///
    /// # Errors
    /// Gaussians that are bound to triangles of another template.
    pub fn new(template: &Template, gaussians: &BoundGaussians) -> Result<Self, ModelError> {
        let (faces, vertices) = (template.faces(), template.vertices().len());
        let most = gaussians.triangles().iter().max();
        let most = most.map_or(0, |triangle| *triangle as usize + 1);
        check_count("template triangles", faces.len(), most.max(faces.len()))?;
        let mut touching: Vec<Vec<u32>> = vec![Vec::new(); vertices];
        for (triangle, corners) in (0..).zip(faces) {
            for corner in corners {
                touching[*corner as usize].push(triangle);
            }
        }
        let (mut starts, mut around) = (vec![0], Vec::new());
        let mut near: Vec<u32> = Vec::new();
        for (triangle, corners) in (0u32..).zip(faces) {
            near.clear();
            for corner in corners {
                near.extend(&touching[*corner as usize]);
            }
            near.sort_unstable();
            near.dedup();
            around.extend(near.iter().filter(|other| **other != triangle));
            starts.push(u32::try_from(around.len()).unwrap_or(u32::MAX));
        }
        Ok(Self {
            faces: faces.to_vec(),
            triangles: gaussians.triangles().to_vec(),
            starts,
            around,
            vertices,
            spheres: Vec::new(),
            found: Vec::new(),
        })
    }

    /// The paper's L_bind (section IV-C): squared distance between each Gaussian's centre and the nearest point of the posed surface,
    /// summed over a `share` of the Gaussians, square metres. `gaussians` and `vertices` (row-major [3, N_v], world) are those of a
    /// [`crate::Posed`].
    ///
    /// Derivatives are added by both: a Gaussian is drawn to the surface, and the surface to it.
    ///
    /// # Errors
    /// Arrays of another number of Gaussians or vertices.
    pub fn bind(
        &mut self,
        (gaussians, vertices): (&Attributes, &[f32]),
        share: Share,
        weight: f32,
        by_gaussians: &mut Attributes,
        by_vertices: &mut [f32],
    ) -> Result<f64, ModelError> {
        let count = self.triangles.len();
        check_count("Gaussians", gaussians.len(), count)?;
        check_count("derivatives by Gaussians", by_gaussians.len(), count)?;
        check_count("vertex coordinates", vertices.len(), 3 * self.vertices)?;
        check_count(
            "derivatives by vertices",
            by_vertices.len(),
            3 * self.vertices,
        )?;
        let all: [&[f32]; ATTRIBUTES] = planes(gaussians.numbers());
        let [xs, ys, zs, ..] = all;
        let planes: [&[f32]; 3] = planes(vertices);
        self.surround(&planes);
        let mut found = std::mem::take(&mut self.found);
        found.resize(share.len(count), Nearest::default());
        let runs = found.par_chunks_mut(PIECE).enumerate();
        let sums = runs.map(|(run, found)| {
            let mut sum = 0.0;
            for (slot, found) in (run * PIECE..).zip(found) {
                let index = share.index(slot);
                let place = Vec3::new(xs[index], ys[index], zs[index]);
                *found = self.nearest(place, self.triangles[index], &planes);
                sum += f64::from(found.away.length_squared());
            }
            sum
        });
        let sums: Vec<f64> = sums.collect();

        let by: [&mut [f32]; ATTRIBUTES] = planes_mut(by_gaussians.numbers_mut());
        let [by_x, by_y, by_z, ..] = by;
        let [of_x, of_y, of_z] = planes_mut::<3>(by_vertices);
        for (slot, nearest) in found.iter().enumerate() {
            let index = share.index(slot);
            let [x, y, z] = (2.0 * weight * nearest.away).to_array();
            by_x[index] += x;
            by_y[index] += y;
            by_z[index] += z;
            for (corner, weight) in nearest.corners.iter().zip(nearest.weights) {
                let corner = *corner as usize;
                of_x[corner] -= weight * x;
                of_y[corner] -= weight * y;
                of_z[corner] -= weight * z;
            }
        }
        self.found = found;
        Ok(f64::from(weight) * sums.iter().sum::<f64>())
    }

    /// Fills `spheres`.
    fn surround(&mut self, planes: &[&[f32]; 3]) {
        let faces = self.faces.par_iter().with_min_len(RUN);
        let spheres = faces.map(|corners| {
            let [a, b, c] = points(planes, corners);
            let centre = (a + b + c) / 3.0;
            let reach = |point: Vec3| point.distance_squared(centre);
            let radius = reach(a).max(reach(b)).max(reach(c)).sqrt();
            Sphere { centre, radius }
        });
        spheres.collect_into_vec(&mut self.spheres);
    }

    fn nearest(&self, place: Vec3, triangle: u32, planes: &[&[f32]; 3]) -> Nearest {
        let on = |triangle: u32| {
            let corners = self.faces[triangle as usize];
            let [a, b, c] = points(planes, &corners);
            let weights = shares_of_closest(place, [a, b, c]);
            let away = place - (a * weights[0] + b * weights[1] + c * weights[2]);
            Nearest {
                corners,
                weights,
                away,
            }
        };
        let mut best = on(triangle);
        let mut distance = best.away.length();
        let range = [0, 1].map(|k| self.starts[triangle as usize + k] as usize);
        for other in &self.around[range[0]..range[1]] {
            let sphere = self.spheres[*other as usize];
            let reach = distance + sphere.radius;
            if place.distance_squared(sphere.centre) > reach * reach {
                continue;
            }
            let nearest = on(*other);
            let nearer = nearest.away.length();
            if nearer < distance {
                (best, distance) = (nearest, nearer);
            }
        }
        best
    }
}

fn points(planes: &[&[f32]; 3], corners: &[u32; 3]) -> [Vec3; 3] {
    corners.map(|corner| {
        let corner = corner as usize;
        Vec3::new(planes[0][corner], planes[1][corner], planes[2][corner])
    })
}
