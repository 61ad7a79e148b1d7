//! Light on a posed person, baked into colours because a degree-0 Gaussian has no other way to show it: a soft sky, a
//! warm key light and a cool fill, each seen from every vertex through small depth maps.
//!
//! It is made for smooth, plausible light in a few tens of milliseconds a pose, not for sharp shadows.

use crate::Part;
use crate::depth_map::DepthMap;
use glam::Vec3;
use rayon::prelude::*;
use spmm3::Template;

/// Directions the sky is sampled in.
const SKY_DIRECTIONS: u16 = 26;

/// Texels along a depth map's side: about 1 cm each on a person with spread arms.
const MAP: usize = 160;

/// How far a vertex is lifted off its surface before it is tested, and by how much it may lie deeper, metres: more than
/// a texel, so that a surface does not shade itself.
const LIFT: f32 = 0.012;
const BIAS: f32 = 0.010;

/// Depth below an occluder over which the light fades, metres.
const PENUMBRA: f32 = 0.01;

/// Rounds of averaging over neighbours, which take the depth maps' steps out.
const SMOOTHING: usize = 3;

/// Direction of the key light: high and from the person's left.
const TOWARDS_KEY: Vec3 = Vec3::new(0.55, 0.62, 0.75);

/// Light from one direction.
#[derive(Debug, Clone, Copy)]
struct Ray {
    /// Towards the light.
    direction: Vec3,
    radiance: Vec3,
}

/// The light around a person, fixed in the person's space, ready for any pose of one template.
#[derive(Debug, Clone)]
pub struct Light {
    rays: Vec<Ray>,
    faces: Vec<[u32; 3]>,
    casters: Vec<[u32; 3]>,
    neighbours: Vec<Vec<u32>>,
    /// How much of the shade a vertex takes, and the least light it keeps.
    shade: Vec<(f32, f32)>,
}

impl Light {
    /// A sky without lamps, a little brighter above: for people whose own light is not known. An open surface that looks sideways gets 1.
    /// `casters` are the triangles that shade.
    #[must_use]
    pub fn sky(template: &Template, casters: Vec<[u32; 3]>) -> Self {
        let faces = template.faces().to_vec();
        let count = f32::from(SKY_DIRECTIONS);
        let mut rays: Vec<Ray> = sphere_directions(SKY_DIRECTIONS)
            .map(|direction| Ray {
                direction,
                radiance: Vec3::splat((1.0 + 0.35 * direction.y) / count),
            })
            .collect();
        let open = |towards: Vec3| -> f32 {
            let facing = |ray: &Ray| (towards.dot(ray.direction) + 0.2).max(0.0) / 1.2;
            rays.iter().map(|ray| facing(ray) * ray.radiance.x).sum()
        };
        let scale = 1.0 / open(Vec3::Z).max(1e-6);
        rays.iter_mut().for_each(|ray| ray.radiance *= scale);
        Self {
            rays,
            neighbours: neighbours(template),
            shade: vec![(1.0, 0.15); template.vertices().len()],
            faces,
            casters,
        }
    }

    /// Prepares the light for poses of a person with this `template`; `parts` are its faces', `vertex_parts` its vertices'.
    #[must_use]
    pub fn new(template: &Template, parts: &[Part], vertex_parts: &[Part]) -> Self {
        let faces = template.faces().to_vec();
        let casts = |part: &Part| {
            !matches!(
                part,
                Part::Brows | Part::Lashes | Part::Eyes | Part::Teeth | Part::Tongue
            )
        };
        let casters = faces
            .iter()
            .zip(parts)
            .filter(|(_, part)| casts(part))
            .map(|(face, _)| *face)
            .collect();
        let shade = vertex_parts
            .iter()
            .copied()
            .map(|part| match part {
                // Eyes in their sockets would go dull, an open mouth black.
                Part::Eyes => (0.35, 0.8),
                Part::Lashes | Part::Brows => (0.5, 0.7),
                Part::Teeth => (0.6, 0.9),
                Part::Tongue => (0.8, 0.5),
                _ => (1.0, 0.22),
            })
            .collect();
        Self {
            rays: rays(),
            faces,
            casters,
            neighbours: neighbours(template),
            shade,
        }
    }

    /// `[N_v]` factors by which the light changes a surface's colour, red, green and blue, at the vertices of a pose
    /// (metres, the person's space). About 1 on a cheek towards the viewer.
    ///
    /// `vertices` must be one pose of the person's template: N_v positions.
    #[must_use]
    pub fn factors(&self, vertices: &[Vec3]) -> Vec<Vec3> {
        let normals = vertex_normals(vertices, &self.faces);
        let maps: Vec<DepthMap> = self
            .rays
            .par_iter()
            .map(|ray| DepthMap::new(ray.direction, MAP, vertices, &self.casters))
            .collect();
        // Summed in the rays' order at every vertex, so that the result is the same on any machine.
        let mut factors: Vec<Vec3> = (vertices, &normals)
            .into_par_iter()
            .map(|(vertex, normal)| {
                let lights = self.rays.iter().zip(&maps);
                lights
                    .map(|(ray, map)| light_from(*ray, map, *vertex, *normal))
                    .sum()
            })
            .collect();
        for _ in 0..SMOOTHING {
            factors = self.smoothed(&factors);
        }
        for (factor, (strength, floor)) in factors.iter_mut().zip(&self.shade) {
            *factor = Vec3::ONE.lerp(*factor, *strength).max(Vec3::splat(*floor));
        }
        factors
    }

    fn smoothed(&self, values: &[Vec3]) -> Vec<Vec3> {
        self.neighbours
            .par_iter()
            .zip(values)
            .map(|(near, own)| {
                let sum: Vec3 = near.iter().map(|v| values[*v as usize]).sum();
                let mean = if near.is_empty() {
                    *own
                } else {
                    sum / near.len() as f32
                };
                own.lerp(mean, 0.5)
            })
            .collect()
    }
}

/// The vertices that follow each one around its triangles.
fn neighbours(template: &Template) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); template.vertices().len()];
    for [a, b, c] in template.faces() {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            neighbours[*from as usize].push(*to);
        }
    }
    neighbours
}

/// What reaches a vertex from one direction.
fn light_from(ray: Ray, map: &DepthMap, vertex: Vec3, normal: Vec3) -> Vec3 {
    // Light wraps a little around edges, as it does through skin and cloth.
    let facing = (normal.dot(ray.direction) + 0.2) / 1.2;
    if facing <= 0.0 {
        return Vec3::ZERO;
    }
    let lifted = vertex + normal * LIFT + ray.direction * BIAS;
    ray.radiance * (facing * map.visibility(lifted, PENUMBRA))
}

/// The light: sky, key and fill, scaled so that a surface that looks at the viewer gets about 1.
fn rays() -> Vec<Ray> {
    let mut rays = Vec::new();
    for direction in sphere_directions(SKY_DIRECTIONS) {
        // Cool from above, a little warm bounce from the floor.
        let sky = Vec3::new(0.94, 0.98, 1.06);
        let floor = Vec3::new(0.60, 0.55, 0.50);
        let radiance = floor.lerp(sky, 0.5 + 0.5 * direction.y);
        rays.push(Ray {
            direction,
            radiance: radiance * (1.9 / f32::from(SKY_DIRECTIONS)),
        });
    }
    let mut lamp = |towards: Vec3, radius: f32, count: u16, radiance: Vec3| {
        let towards = towards.normalize();
        let x = towards.any_orthonormal_vector();
        let y = towards.cross(x);
        for k in 0..count {
            let r = radius * ((f32::from(k) + 0.5) / f32::from(count)).sqrt();
            let angle = golden_angle() * f32::from(k);
            let direction = (towards + (x * angle.cos() + y * angle.sin()) * r).normalize();
            rays.push(Ray {
                direction,
                radiance: radiance / f32::from(count),
            });
        }
    };
    lamp(TOWARDS_KEY, 0.35, 6, Vec3::new(0.62, 0.58, 0.52));
    lamp(
        Vec3::new(-0.8, 0.25, 0.55),
        0.3,
        3,
        Vec3::new(0.15, 0.17, 0.20),
    );
    // From behind, so that the back is not in the dark.
    lamp(
        Vec3::new(-0.35, 0.6, -0.8),
        0.3,
        3,
        Vec3::new(0.32, 0.33, 0.35),
    );
    let towards_viewer = Vec3::new(0.0, 0.15, 1.0).normalize();
    let reference: f32 = rays
        .iter()
        .map(|ray| {
            let facing = (towards_viewer.dot(ray.direction) + 0.2).max(0.0) / 1.2;
            ray.radiance.element_sum() / 3.0 * facing
        })
        .sum();
    for ray in &mut rays {
        ray.radiance *= 1.04 / reference;
    }
    rays
}

/// The normal of a mirror that shows the key light to a viewer in front.
pub(crate) fn half_way_to_key() -> Vec3 {
    (TOWARDS_KEY.normalize() + Vec3::Z).normalize()
}

fn golden_angle() -> f32 {
    std::f32::consts::PI * (3.0 - 5.0f32.sqrt())
}

/// `count` directions spread evenly over the sphere (Fibonacci's spiral).
pub(crate) fn sphere_directions(count: u16) -> impl Iterator<Item = Vec3> {
    (0..count).map(move |k| {
        let y = 1.0 - 2.0 * (f32::from(k) + 0.5) / f32::from(count);
        let ring = (1.0 - y * y).sqrt();
        let angle = golden_angle() * f32::from(k);
        Vec3::new(ring * angle.cos(), y, ring * angle.sin())
    })
}

/// Unit normals at the vertices, weighted by the faces' areas; up where a vertex has none.
pub(crate) fn vertex_normals(vertices: &[Vec3], faces: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; vertices.len()];
    for face in faces {
        let [a, b, c] = face.map(|v| vertices[v as usize]);
        let normal = (b - a).cross(c - a);
        for corner in face {
            normals[*corner as usize] += normal;
        }
    }
    normals
        .into_iter()
        .map(|n| n.try_normalize().unwrap_or(Vec3::Y))
        .collect()
}
