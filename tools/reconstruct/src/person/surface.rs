//! The person's surface as curved patches cut into cells: where a Gaussian lies, how large it is, which colour it takes.
//!
//! The cells are cut with relaxed arms, because the T-pose squeezes the shoulders' cloth into folds whose Gaussians would
//! stick out once an arm comes down. Each is then carried into the T-pose in its triangle's frame.

use super::range_of_motion::{range_of_motion, relaxed_arms};
use super::visible::visible_faces;
use super::{Part, Person};
use crate::shading::{half_way_to_key, vertex_normals};
use glam::{Mat2, Mat3, Quat, Vec2, Vec3};
use rayon::prelude::*;
use spmm3::triangle_frame;
use std::collections::HashSet;

/// Standard deviation over cell size: neighbours overlap without blurring the texture.
const SIGMA_OF_CELL: f32 = 0.66;

/// Thickness over the smaller standard deviation.
const THICKNESS: f32 = 0.25;

const OPACITY: f32 = 0.98;

/// Cells of hair, brows and lashes more transparent than this are left out.
const MIN_ALPHA: f32 = 0.12;

/// Normals of the eyeball that look further back than this never show between the lids (z component).
const BACK_OF_THE_EYE: f32 = 0.1;

/// Where the glint on the eye begins and how soft its edge is (cosines).
const GLINT_EDGE: f32 = 0.990;
const GLINT_BLUR: f32 = 0.005;

/// The teeth's texture is whiter than a mouth lets them be.
const TEETH_TINT: Vec3 = Vec3::new(1.0, 0.97, 0.92);

/// How far behind the front teeth the mouth is dark, metres: too fine for the depth maps of the light.
const DARK_MOUTH: f32 = 0.028;

/// A pose may stretch a cell this far; beyond, gaps are for the networks to close. Lids unfold; cloth that shears would
/// show larger Gaussians as spikes.
const MAX_STRETCH_FACE: f32 = 3.0;
const MAX_STRETCH: f32 = 1.35;

/// Size of a cell's Gaussian across an open border of the mesh (a hem, a lapel, a lock), which it would blur.
const BORDER_SHARPNESS: f32 = 0.7;

/// How far Gaussians lift off the flat quad towards the smooth surface its normals suggest (Phong tessellation).
const ROUNDNESS: f32 = 0.6;

/// And at most this far, metres: what floats off its triangle swings when the triangle turns.
const MAX_LIFT: f32 = 0.004;

/// Gaussians a metre along an edge, relative to cloth.
fn density(part: Part) -> f32 {
    match part {
        Part::Face => 3.2,
        Part::Head => 2.0,
        Part::Teeth | Part::Tongue => 1.6,
        Part::Hand => 2.0,
        Part::Skin => 1.2,
        Part::Jacket | Part::Shirt | Part::Jeans | Part::Shoes => 1.0,
        Part::Hair => 1.8,
        Part::Eyes => 6.0,
        // Strands finer than a pixel would only darken the eyes from afar.
        Part::Brows | Part::Lashes => 6.0,
    }
}

/// A cell that becomes one Gaussian.
pub(super) struct Cell {
    pub(super) position: Vec3,
    pub(super) rotation: Quat,
    pub(super) scales: Vec3,
    pub(super) opacity: f32,
    pub(super) albedo: Vec3,
    pub(super) triangle: u32,
    pub(super) barycentric: [f32; 2],
    pub(super) part: Part,
}

/// The template's quads, smoothly curved.
pub(super) struct Surface<'a> {
    person: &'a Person,
    /// The mesh with relaxed arms, and its normals.
    relaxed: Vec<Vec3>,
    normals: Vec<Vec3>,
    visible: Vec<bool>,
    /// Edges of a single quad, the smaller vertex first.
    open_edges: HashSet<(u32, u32)>,
    /// z of the foremost tooth, metres.
    front_teeth: f32,
    /// `[N_f / 2]` how far each quad's two edge directions stretch in some pose, 1..=3.
    stretch: Vec<Vec2>,
}

/// The edges that only one quad has. Triangles come as halves 012 and 023 of a quad.
fn open_edges(faces: &[[u32; 3]]) -> HashSet<(u32, u32)> {
    let mut open = HashSet::new();
    for halves in faces.chunks(2) {
        let corners = corners(halves);
        for k in 0..4 {
            let (a, b) = (corners[k], corners[(k + 1) % 4]);
            let edge = (a.min(b), a.max(b));
            if !open.insert(edge) {
                open.remove(&edge);
            }
        }
    }
    open
}

/// The corners of a quad from its halves 012 and 023.
fn corners(halves: &[[u32; 3]]) -> [u32; 4] {
    let [a, b, c] = halves[0];
    [a, b, c, halves[halves.len() - 1][2]]
}

/// One quad of the surface.
struct Patch {
    corners: [Vec3; 4],
    normals: [Vec3; 4],
    uvs: [Vec2; 4],
    part: Part,
    stretch: Vec2,
    roundness: f32,
    /// Whether the edges 01, 12, 23 and 30 belong to this quad alone.
    open: [bool; 4],
    /// z of the foremost tooth, metres.
    front_teeth: f32,
}

/// Mean lengths of a quad's opposite edges: from corner 0 to 1, and from 0 to 3.
fn edges([a, b, c, d]: [Vec3; 4]) -> Vec2 {
    0.5 * Vec2::new(a.distance(b) + d.distance(c), a.distance(d) + b.distance(c))
}

fn bilinear<T>(corners: &[T; 4], u: f32, v: f32) -> T
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
{
    corners[0] * ((1.0 - u) * (1.0 - v))
        + corners[1] * (u * (1.0 - v))
        + corners[2] * (u * v)
        + corners[3] * ((1.0 - u) * v)
}

impl Patch {
    /// Cells along the two edges.
    fn grid(&self, spacing: f32) -> (u32, u32) {
        let lengths = edges(self.corners) * self.stretch;
        let cells = |length: f32| {
            #[allow(clippy::cast_possible_truncation, reason = "an edge has few cells")]
            let cells = (length * density(self.part) / spacing)
                .round()
                .clamp(1.0, 1000.0) as u32;
            cells
        };
        (cells(lengths.x), cells(lengths.y))
    }

    /// Whether the texture's alpha shapes this patch into strands.
    fn is_see_through(&self) -> bool {
        matches!(self.part, Part::Hair | Part::Brows | Part::Lashes)
    }

    /// Which half of the quad `u`, `v` lies on (012 or 023), and the barycentric weights of its second and third corner.
    fn half(u: f32, v: f32) -> (u32, [f32; 2]) {
        if v <= u {
            (0, [u - v, v])
        } else {
            (1, [u, v - u])
        }
    }

    /// Phong tessellation (Boubekeur and Alexa 2008) of the two triangles.
    fn point(&self, u: f32, v: f32) -> Vec3 {
        let (half, [second, third]) = Self::half(u, v);
        let corners = if half == 0 { [0, 1, 2] } else { [0, 2, 3] };
        let shares = [1.0 - second - third, second, third];
        let weigh = |points: [Vec3; 3]| -> Vec3 {
            points.iter().zip(shares).map(|(p, share)| *p * share).sum()
        };
        let flat = weigh(corners.map(|k: usize| self.corners[k]));
        let onto = weigh(corners.map(|k: usize| {
            flat - self.normals[k] * (flat - self.corners[k]).dot(self.normals[k])
        }));
        flat + (self.roundness * (onto - flat)).clamp_length_max(MAX_LIFT)
    }

    fn cell(
        &self,
        quad: u32,
        (i, j): (u32, u32),
        (n_u, n_v): (u32, u32),
        person: &Person,
    ) -> Option<Cell> {
        let size = Vec2::new(1.0 / n_u as f32, 1.0 / n_v as f32);
        let low = Vec2::new(i as f32, j as f32) * size;
        let (u, v) = (low + 0.5 * size).into();
        let (mut albedo, alpha) = person
            .texture(self.part)
            .mean(|x, y| bilinear(&self.uvs, low.x + x * size.x, low.y + y * size.y));
        let mut opacity = OPACITY;
        if self.is_see_through() {
            if alpha < MIN_ALPHA {
                return None;
            }
            opacity *= alpha
                * match self.part {
                    Part::Brows => 0.5,
                    Part::Lashes => 0.6,
                    _ => 1.0,
                };
        }
        if self.part == Part::Teeth {
            albedo *= TEETH_TINT;
        }
        if matches!(self.part, Part::Teeth | Part::Tongue) {
            let depth = (self.front_teeth - self.point(u, v).z) / DARK_MOUTH;
            albedo *= 1.0 - 0.75 * depth.clamp(0.0, 1.0);
        }
        if self.part == Part::Eyes {
            // A glint where the key light mirrors towards the viewer: without it eyes look dead.
            let towards = bilinear(&self.normals, u, v).normalize_or_zero();
            let glint =
                ((towards.dot(half_way_to_key()) - GLINT_EDGE) / GLINT_BLUR).clamp(0.0, 1.0);
            albedo = albedo.lerp(Vec3::ONE, 0.85 * glint);
        }
        let along_u = self.point(u + 0.5 * size.x, v) - self.point(u - 0.5 * size.x, v);
        let along_v = self.point(u, v + 0.5 * size.y) - self.point(u, v - 0.5 * size.y);
        let normal = along_u.cross(along_v).try_normalize()?;
        let x = along_u.try_normalize()?;
        let y = normal.cross(x);
        // A skewed cell's covariance in its plane: its principal axes are the Gaussian's.
        // Gaussians do not grow with the mesh, so they are made for the pose that stretches them most: they overlap in
        // this one, as a lid does that is folded away.
        let [below, right, above, left] = self.open;
        let sharpened = |open: bool| if open { BORDER_SHARPNESS } else { 1.0 };
        let size_u = self.stretch.x * sharpened((left && i == 0) || (right && i + 1 == n_u));
        let size_v = self.stretch.y * sharpened((below && j == 0) || (above && j + 1 == n_v));
        let cell = Mat2::from_cols(
            Vec2::new(along_u.length(), 0.0) * size_u,
            Vec2::new(along_v.dot(x), along_v.dot(y)) * size_v,
        );
        let covariance = cell * cell.transpose();
        let (p, q, r) = (
            covariance.x_axis.x,
            covariance.x_axis.y,
            covariance.y_axis.y,
        );
        let turn = 0.5 * (2.0 * q).atan2(p - r);
        let spread = (0.25 * (p - r) * (p - r) + q * q).sqrt();
        let major = (0.5 * (p + r) + spread).sqrt();
        let minor = (0.5 * (p + r) - spread).max(1e-12).sqrt();
        let axis = x * turn.cos() + y * turn.sin();
        let (major, minor) = (
            SIGMA_OF_CELL * major,
            SIGMA_OF_CELL * minor.max(0.05 * major),
        );
        let scales = Vec3::new(major, minor, THICKNESS * minor).max(Vec3::splat(2e-5));
        let (half, barycentric) = Self::half(u, v);
        Some(Cell {
            position: self.point(u, v),
            rotation: Quat::from_mat3(&Mat3::from_cols(axis, normal.cross(axis), normal))
                .normalize(),
            scales,
            opacity,
            albedo,
            triangle: 2 * quad + half,
            barycentric,
            part: self.part,
        })
    }
}

impl<'a> Surface<'a> {
    pub(super) fn new(person: &'a Person) -> Self {
        let template = person.template();
        let relaxed = relaxed_arms(person);
        let normals = vertex_normals(&relaxed, template.faces());
        let front_teeth = (relaxed.iter())
            .zip(person.vertex_parts())
            .filter(|(_, part)| *part == Part::Teeth)
            .map(|(vertex, _)| vertex.z)
            .fold(f32::NEG_INFINITY, f32::max);
        let mut visible = visible_faces(person);
        for ((visible, face), part) in visible.iter_mut().zip(template.faces()).zip(person.parts())
        {
            *visible &= *part != Part::Eyes || normals[face[0] as usize].z > BACK_OF_THE_EYE;
        }
        let range = range_of_motion(person);
        let stretch = template
            .faces()
            .par_chunks(2)
            .zip(person.parts().par_chunks(2))
            .map(|(halves, parts)| {
                let limit = match parts[0] {
                    Part::Face => MAX_STRETCH_FACE,
                    _ => MAX_STRETCH,
                };
                let lengths =
                    |vertices: &[Vec3]| edges(corners(halves).map(|v| vertices[v as usize]));
                let rest = lengths(&relaxed).max(Vec2::splat(1e-6));
                range
                    .iter()
                    .map(|posed| lengths(posed) / rest)
                    .fold(Vec2::ONE, Vec2::max)
                    .min(Vec2::splat(limit))
            })
            .collect();
        Self {
            person,
            relaxed,
            normals,
            visible,
            open_edges: open_edges(template.faces()),
            front_teeth,
            stretch,
        }
    }

    fn patch(&self, quad: u32) -> Patch {
        let (first, second) = (2 * quad as usize, 2 * quad as usize + 1);
        let corners = corners(&self.person.template().faces()[first..=second]);
        let uvs = self.person.uvs();
        let open = [0, 1, 2, 3].map(|k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % 4]);
            self.open_edges.contains(&(a.min(b), a.max(b)))
        });
        let normals = corners.map(|v| self.normals[v as usize]);
        let corners = corners.map(|v| self.relaxed[v as usize]);
        let flat = (corners[2] - corners[0])
            .cross(corners[3] - corners[1])
            .normalize_or_zero();
        let sharpest = normals.map(|n| n.dot(flat)).into_iter().fold(1.0, f32::min);
        Patch {
            corners,
            normals,
            // A fold (a hem, the rim of a sole) is not a sampled curve: its normals would throw Gaussians off it.
            roundness: ROUNDNESS * ((sharpest - 0.5) / 0.3).clamp(0.0, 1.0),
            uvs: [uvs[first][0], uvs[first][1], uvs[first][2], uvs[second][2]],
            part: self.person.parts()[first],
            stretch: self.stretch[quad as usize],
            open,
            front_teeth: self.front_teeth,
        }
    }

    fn quads(&self) -> impl ParallelIterator<Item = u32> {
        let quads = u32::try_from(self.person.parts().len() / 2).unwrap_or(0);
        (0..quads)
            .into_par_iter()
            .filter(|quad| self.is_visible(*quad))
    }

    fn is_visible(&self, quad: u32) -> bool {
        let first = 2 * quad as usize;
        self.visible[first] || self.visible[first + 1]
    }

    /// Number of cells at a spacing (metres, on cloth).
    pub(super) fn count(&self, spacing: f32) -> usize {
        self.quads()
            .map(|quad| {
                let patch = self.patch(quad);
                if patch.is_see_through() {
                    return self.cells_of(quad, spacing).count();
                }
                let (n_u, n_v) = patch.grid(spacing);
                n_u as usize * n_v as usize
            })
            .sum()
    }

    /// The cells at a spacing, quad by quad, in the template's T-pose.
    pub(super) fn cells(&self, spacing: f32) -> Vec<Cell> {
        self.quads()
            .flat_map_iter(|quad| self.cells_of(quad, spacing))
            .map(|cell| self.in_t_pose(cell))
            .collect()
    }

    fn in_t_pose(&self, mut cell: Cell) -> Cell {
        let template = self.person.template();
        let face = template.faces()[cell.triangle as usize];
        let from = face.map(|v| self.relaxed[v as usize]);
        let to = face.map(|v| template.vertices()[v as usize]);
        let [v, w] = cell.barycentric;
        let anchor = |[a, b, c]: [Vec3; 3]| a + (b - a) * v + (c - a) * w;
        let t_pose_from_relaxed =
            Quat::from_mat3(&(triangle_frame(to) * triangle_frame(from).transpose()));
        cell.position = anchor(to) + t_pose_from_relaxed * (cell.position - anchor(from));
        cell.rotation = (t_pose_from_relaxed * cell.rotation).normalize();
        cell
    }

    fn cells_of(&self, quad: u32, spacing: f32) -> impl Iterator<Item = Cell> {
        let patch = self.patch(quad);
        let grid = patch.grid(spacing);
        (0..grid.0 * grid.1)
            .filter_map(move |k| patch.cell(quad, (k % grid.0, k / grid.0), grid, self.person))
    }
}
