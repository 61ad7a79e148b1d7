//! Light on a posed person, baked into colours because a degree-0 Gaussian has no other way to show it: a soft sky, a
//! warm key light and a cool fill, each seen from every vertex through small depth maps.
//!
//! It is made for smooth, plausible light in a few tens of milliseconds a pose, not for sharp shadows.

use crate::{Part, Person};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// Directions the sky is sampled in.
const SKY_DIRECTIONS: u16 = 32;

/// Texels along a depth map's side: about 1 cm each on a person with spread arms.
const MAP: usize = 192;

/// How far a vertex is lifted off its surface before it is tested, and by how much it may lie deeper, metres: more than
/// a texel, so that a surface does not shade itself.
const LIFT: f32 = 0.012;
const BIAS: f32 = 0.010;

/// Depth below an occluder over which the light fades, metres.
const PENUMBRA: f32 = 0.01;

/// Rounds of averaging over neighbours, which take the depth maps' steps out.
const SMOOTHING: usize = 3;

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
    /// Prepares the light for poses of `person`.
    #[must_use]
    pub fn new(person: &Person) -> Self {
        let faces = person.template().faces().to_vec();
        let casts = |part: &Part| !matches!(part, Part::Brows | Part::Lashes | Part::Eyes);
        let casters = faces
            .iter()
            .zip(person.parts())
            .filter(|(_, part)| casts(part))
            .map(|(face, _)| *face)
            .collect();
        let mut neighbours = vec![Vec::new(); person.template().vertices().len()];
        for [a, b, c] in &faces {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                neighbours[*from as usize].push(*to);
            }
        }
        let shade = person
            .vertex_parts()
            .into_iter()
            .map(|part| match part {
                // Eyes in their sockets would go dull, an open mouth black.
                Part::Eyes => (0.35, 0.8),
                Part::Lashes | Part::Brows => (0.5, 0.7),
                Part::Teeth | Part::Tongue => (1.0, 0.45),
                _ => (1.0, 0.12),
            })
            .collect();
        Self {
            rays: rays(),
            faces,
            casters,
            neighbours,
            shade,
        }
    }

    /// [N_v] factors by which the light changes a surface's colour, red, green and blue, at the vertices of a pose
    /// (metres, the person's space). About 1 on a cheek towards the viewer.
    ///
    /// `vertices` must be one pose of the person's template: N_v positions.
    #[must_use]
    pub fn factors(&self, vertices: &[Vec3]) -> Vec<Vec3> {
        let normals = vertex_normals(vertices, &self.faces);
        let sum = self
            .rays
            .par_iter()
            .map(|ray| self.light_from(*ray, vertices, &normals))
            .reduce(
                || vec![Vec3::ZERO; vertices.len()],
                |mut a, b| {
                    a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                    a
                },
            );
        let mut factors = sum;
        for _ in 0..SMOOTHING {
            factors = self.smoothed(&factors);
        }
        for (factor, (strength, floor)) in factors.iter_mut().zip(&self.shade) {
            *factor = Vec3::ONE
                .lerp(*factor, *strength)
                .max(Vec3::splat(*floor));
        }
        factors
    }

    fn light_from(&self, ray: Ray, vertices: &[Vec3], normals: &[Vec3]) -> Vec<Vec3> {
        let map = DepthMap::new(ray.direction, vertices, &self.casters);
        vertices
            .iter()
            .zip(normals)
            .map(|(vertex, normal)| {
                // Light wraps a little around edges, as it does through skin and cloth.
                let facing = (normal.dot(ray.direction) + 0.2) / 1.2;
                if facing <= 0.0 {
                    return Vec3::ZERO;
                }
                let lifted = *vertex + *normal * LIFT + ray.direction * BIAS;
                ray.radiance * (facing * map.visibility(lifted))
            })
            .collect()
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

/// The light: sky, key and fill, scaled so that a surface that looks at the viewer gets about 1.
fn rays() -> Vec<Ray> {
    let mut rays = Vec::new();
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    for k in 0..SKY_DIRECTIONS {
        let y = 1.0 - 2.0 * (f32::from(k) + 0.5) / f32::from(SKY_DIRECTIONS);
        let ring = (1.0 - y * y).sqrt();
        let angle = golden * f32::from(k);
        let direction = Vec3::new(ring * angle.cos(), y, ring * angle.sin());
        // Cool from above, a little warm bounce from the floor.
        let sky = Vec3::new(0.94, 0.98, 1.06);
        let floor = Vec3::new(0.50, 0.46, 0.42);
        let radiance = floor.lerp(sky, 0.5 + 0.5 * y) * (1.0 + 0.25 * direction.z);
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
            let angle = golden * f32::from(k);
            let direction = (towards + (x * angle.cos() + y * angle.sin()) * r).normalize();
            rays.push(Ray {
                direction,
                radiance: radiance / f32::from(count),
            });
        }
    };
    lamp(Vec3::new(0.55, 0.62, 0.75), 0.35, 8, Vec3::new(0.62, 0.58, 0.52));
    lamp(Vec3::new(-0.8, 0.25, 0.55), 0.3, 4, Vec3::new(0.13, 0.15, 0.18));
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

/// The surface nearest to a distant light.
struct DepthMap {
    light_from_person: Mat3,
    low: Vec3,
    texels_per_metre: f32,
    /// Height towards the light, metres.
    nearest: Vec<f32>,
}

impl DepthMap {
    fn new(towards: Vec3, vertices: &[Vec3], casters: &[[u32; 3]]) -> Self {
        let x = towards.any_orthonormal_vector();
        let person_from_light = Mat3::from_cols(x, towards.cross(x), towards);
        let light_from_person = person_from_light.transpose();
        let seen: Vec<Vec3> = vertices.iter().map(|v| light_from_person * *v).collect();
        let low = seen.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = seen.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        // Two texels of margin on every side.
        let extent = (high - low).truncate().max_element().max(1e-3);
        let texels_per_metre = (MAP - 4) as f32 / extent;
        let low = low - 2.0 / texels_per_metre;
        let mut map = Self {
            light_from_person,
            low,
            texels_per_metre,
            nearest: vec![f32::NEG_INFINITY; MAP * MAP],
        };
        for caster in casters {
            let [a, b, c] = caster.map(|v| {
                let p = seen[v as usize];
                ((p - low) * texels_per_metre).truncate().extend(p.z)
            });
            map.draw(a, b, c);
        }
        map
    }

    /// Draws a triangle in texels; a triangle too small to cover a texel's centre still marks the one it is in.
    fn draw(&mut self, a: Vec3, b: Vec3, c: Vec3) {
        let low = a.min(b).min(c);
        let high = a.max(b).max(c);
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        #[allow(clippy::cast_possible_truncation, reason = "texels of a small map")]
        let texel = |v: f32| (v.max(0.0) as usize).min(MAP - 1);
        let centre = (a + b + c) / 3.0;
        self.mark(texel(centre.x), texel(centre.y), centre.z);
        if area.abs() < 1e-6 {
            return;
        }
        for y in texel(low.y)..=texel(high.y) {
            for x in texel(low.x)..=texel(high.x) {
                let p = Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 0.0);
                let wb = (p - a).truncate().perp_dot((c - a).truncate()) / area;
                let wc = (b - a).truncate().perp_dot((p - a).truncate()) / area;
                if wb >= 0.0 && wc >= 0.0 && wb + wc <= 1.0 {
                    self.mark(x, y, a.z + wb * (b.z - a.z) + wc * (c.z - a.z));
                }
            }
        }
    }

    fn mark(&mut self, x: usize, y: usize, height: f32) {
        let slot = &mut self.nearest[y * MAP + x];
        *slot = slot.max(height);
    }

    /// How much of the light reaches `point`, 0..=1: soft tests of 3 x 3 texels under a quadratic B-spline.
    fn visibility(&self, point: Vec3) -> f32 {
        let seen = self.light_from_person * point;
        let at = (seen - self.low) * self.texels_per_metre - 0.5;
        let middle = at.round();
        let past = at - middle;
        let weights = |d: f32| {
            [
                0.5 * (0.5 - d) * (0.5 - d),
                0.75 - d * d,
                0.5 * (0.5 + d) * (0.5 + d),
            ]
        };
        #[allow(clippy::cast_possible_truncation, reason = "clamped to the map")]
        let texel = |v: f32| v.clamp(0.0, (MAP - 1) as f32) as usize;
        let mut lit = 0.0;
        for (j, wy) in (-1i8..).zip(weights(past.y)) {
            let row = texel(middle.y + f32::from(j)) * MAP;
            for (i, wx) in (-1i8..).zip(weights(past.x)) {
                let height = self.nearest[row + texel(middle.x + f32::from(i))];
                lit += wx * wy * (1.0 - (height - seen.z) / PENUMBRA).clamp(0.0, 1.0);
            }
        }
        lit
    }
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
