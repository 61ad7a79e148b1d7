//! A person's surface in small Gaussians: a grid of cells on every quad, as a training would leave them, with its noise.

use super::SyntheticPerson;
use super::person::normal;
use crate::scan::Scan;
use glam::{DMat3, DVec3, Quat, Vec2, Vec3};
use reconstruct::Part;

/// One Gaussian's place on the mesh, whatever its pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// The triangle of the mesh that it lies on.
    pub(super) triangle: u32,
    corners: [u32; 4],
    /// Its middle along the quad's two directions, 0..=1.
    at: [f64; 2],
    /// The quad's cells along them.
    counts: [u16; 2],
    albedo: Vec3,
    opacity: f32,
}

impl SyntheticPerson {
    /// About `target` cells, denser on face and hands.
    pub(super) fn cells(&self, target: usize) -> Vec<Cell> {
        let vertices = self.posed(&self.stance());
        let (mut fine, mut coarse) = (5e-4f64.ln(), 0.1f64.ln());
        for _ in 0..20 {
            let middle = 0.5 * (fine + coarse);
            let count: usize = (0..self.quads.len())
                .map(|quad| {
                    let [u, v] = self.counts(quad, &vertices, middle.exp());
                    usize::from(u) * usize::from(v)
                })
                .sum();
            if count > target {
                fine = middle;
            } else {
                coarse = middle;
            }
        }
        let spacing = (0.5 * (fine + coarse)).exp();
        let mut rng = fastrand::Rng::with_seed(self.seed());
        let mut cells = Vec::with_capacity(target);
        for quad in 0..self.quads.len() {
            let counts = self.counts(quad, &vertices, spacing);
            for i in 0..counts[0] {
                for j in 0..counts[1] {
                    let middle = |k: u16, n: u16| (f64::from(k) + 0.5) / f64::from(n);
                    let at = [middle(i, counts[0]), middle(j, counts[1])];
                    // Of the halves 012 and 023.
                    let half = u32::from(at[0] < at[1]);
                    cells.push(Cell {
                        triangle: 2 * self.quad_numbers[quad] + half,
                        corners: self.quads[quad].corners,
                        at,
                        counts,
                        albedo: self.albedo(quad, at),
                        opacity: 0.99 - 0.25 * rng.f32() * rng.f32(),
                    });
                }
            }
        }
        cells
    }

    fn counts(&self, quad: usize, vertices: &[DVec3], spacing: f64) -> [u16; 2] {
        let [a, b, c, d] = self.quads[quad].corners.map(|v| vertices[v as usize]);
        let density = match self.parts[quad] {
            Part::Eyes => 3.0,
            Part::Face => 1.8,
            Part::Hand => 1.3,
            _ => 1.0,
        };
        let along = |x: DVec3, y: DVec3| {
            let cells = (0.5 * (x.length() + y.length()) * density / spacing).round();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "1 to 40"
            )]
            let count = cells.clamp(1.0, 40.0) as u16;
            count
        };
        [along(b - a, c - d), along(d - a, c - b)]
    }

    /// The unlit colour of a place of a quad, display values 0..=1.
    fn albedo(&self, quad: usize, [s, t]: [f64; 2]) -> Vec3 {
        let shares = shares([s, t]);
        let corners = &self.quads[quad];
        let uv: Vec2 = (corners.uvs.iter().zip(shares))
            .map(|(uv, share)| {
                #[expect(clippy::cast_possible_truncation, reason = "a share of 1")]
                let share = share as f32;
                *uv * share
            })
            .sum();
        if self.parts[quad] == Part::Eyes {
            return self.eye_texture.sample(uv).truncate();
        }
        let skin = self.skin_texture.sample(uv).truncate();
        let Some([shirt, trousers]) = self.clothes else {
            return skin;
        };
        let clothed: f64 = (corners.corners.iter().zip(shares))
            .map(|(v, share)| self.clothed[*v as usize] * share)
            .sum();
        if clothed < 0.5 {
            return skin;
        }
        // In the texture the trunk lies above the legs; checks give the eye (and a fit) something to hold on to.
        let cloth = if uv.y > 0.53 { shirt } else { trousers };
        let check = ((uv.x * 90.0).sin() * (uv.y * 90.0).sin()).signum();
        (cloth * (1.0 + 0.12 * check)).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// The Gaussians of cells on a posed mesh. The light is that of the stance: a scan's colours hold it whatever the person does later.
    pub(super) fn splat(&self, cells: &[Cell], vertices: &[DVec3], noise: f32) -> Scan {
        let normals = self.normals(vertices);
        let lit = self.normals(&self.posed(&self.stance()));
        let mut rng = fastrand::Rng::with_seed(self.seed() ^ 77);
        let mut scan = Scan::default();
        for cell in cells {
            let [a, b, c, d] = cell.corners.map(|v| vertices[v as usize]);
            let shares = shares(cell.at);
            let mix = |values: &[DVec3]| -> DVec3 {
                let corners = cell.corners.iter().zip(shares);
                corners.map(|(v, share)| values[*v as usize] * share).sum()
            };
            let up = mix(&normals).normalize_or(DVec3::Y);
            let along = b.lerp(c, cell.at[1]) - a.lerp(d, cell.at[1]);
            let x = (along - up * along.dot(up)).normalize_or(up.any_orthonormal_vector());
            let y = up.cross(x);
            let across = (d.lerp(c, cell.at[0]) - a.lerp(b, cell.at[0])).dot(y).abs();
            let jitter = DVec3::new(normal(&mut rng), normal(&mut rng), normal(&mut rng));
            let at = mix(vertices) + jitter * f64::from(noise);
            let grain = 1.0 + 0.03 * normal(&mut rng);
            let size = 0.6 * (1.0 + 0.1 * normal(&mut rng));
            let light = 0.62 + 0.38 * mix(&lit).normalize_or(DVec3::Y).dot(KEY).clamp(-0.3, 1.0);
            let scales = DVec3::new(
                along.length() / f64::from(cell.counts[0]) * size,
                across / f64::from(cell.counts[1]) * size,
                0.001,
            );
            scan.positions.push(at.as_vec3());
            scan.rotations
                .push(Quat::from_mat3(&DMat3::from_cols(x, y, up).as_mat3()).normalize());
            scan.scales.push(scales.max(DVec3::splat(3e-4)).as_vec3());
            scan.opacities.push(cell.opacity);
            #[expect(clippy::cast_possible_truncation, reason = "about 1")]
            let lit = cell.albedo * (light * grain) as f32;
            scan.colours.push(lit.clamp(Vec3::ZERO, Vec3::ONE));
        }
        scan
    }
}

/// Towards the key light, about a unit vector.
const KEY: DVec3 = DVec3::new(0.3, 0.81, 0.5);

/// The corners' shares at a place of a quad.
fn shares([s, t]: [f64; 2]) -> [f64; 4] {
    [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]
}
