//! F_m2g: Gaussians bound to template triangles (paper, section IV-B, hierarchical position dynamics).
//!
//! A Gaussian keeps its triangle, barycentric coordinates, and its attributes in the triangle's own frame. Posing moves
//! the frame: the coarse position follows the mesh, and the network's residuals (F_attr) refine it within the frame, so
//! that a learned wrinkle turns with the arm it is on.

use crate::{ATTRIBUTES, GaussianSet, PersonError, Template, attribute};
use glam::{Mat3, Quat, Vec3};
use half::f16;
use rayon::prelude::*;

/// The largest standard deviation of a person's Gaussian, metres: half of one covers a torso. The demo person's largest has 21 mm.
pub const MOST_SCALE: f32 = 0.5;

/// Gaussians handled by one task: large enough to hide the hand-over, small enough to balance two cores.
const CHUNK: usize = 1024;

/// Vertex positions as three planes of N_v, the deform graph's [3, N_v] output.
#[derive(Debug, Clone, Copy)]
pub struct PlanarVertices<'a> {
    x: &'a [f32],
    y: &'a [f32],
    z: &'a [f32],
}

impl<'a> PlanarVertices<'a> {
    /// Splits a row-major [3, N_v] tensor (metres).
    ///
    /// # Errors
    /// If the length is not 3 x `vertices`.
    pub fn new(planes: &'a [f32], vertices: usize) -> Result<Self, PersonError> {
        PersonError::check_count("posed vertex coordinates", planes.len(), 3 * vertices)?;
        let (x, rest) = planes.split_at(vertices);
        let (y, z) = rest.split_at(vertices);
        Ok(Self { x, y, z })
    }

    fn get(&self, vertex: u32) -> Vec3 {
        let v = vertex as usize;
        Vec3::new(self.x[v], self.y[v], self.z[v])
    }
}

/// Template Gaussians bound to a mesh: the paper's G_template in local frames, and the map F_m2g.
#[derive(Debug, Clone, PartialEq)]
pub struct BoundGaussians {
    corners: Vec<[u32; 3]>,
    triangles: Vec<u32>,
    barycentrics: Vec<[f32; 2]>,
    attributes: Vec<f32>,
    vertices: usize,
}

impl BoundGaussians {
    /// Takes N_g triangle indices, the barycentric weights of each triangle's second and third corner, and the 14
    /// attribute planes (row-major [14, N_g], see [`attribute`]) in the triangles' frames.
    ///
    /// # Errors
    /// If counts differ, an index is out of range, or a number is not finite or out of its plane's range.
    pub fn new(
        template: &Template,
        triangles: Vec<u32>,
        barycentrics: Vec<[f32; 2]>,
        attributes: Vec<f32>,
    ) -> Result<Self, PersonError> {
        let count = triangles.len();
        PersonError::check_count("barycentrics", barycentrics.len(), count)?;
        PersonError::check_count("Gaussian attributes", attributes.len(), ATTRIBUTES * count)?;
        let faces = template.faces();
        PersonError::check_indices(
            "Gaussian triangle",
            triangles.iter().map(|t| *t as usize),
            faces.len(),
        )?;
        PersonError::check_range(
            "barycentric",
            bytemuck::cast_slice(&barycentrics),
            -1.0,
            2.0,
            "-1..2",
        )?;
        PersonError::check_range(
            "Gaussian attribute",
            &attributes,
            -100.0,
            100.0,
            "-100..100",
        )?;
        let corners = triangles.iter().map(|t| faces[*t as usize]).collect();
        Ok(Self {
            corners,
            triangles,
            barycentrics,
            attributes,
            vertices: template.vertices().len(),
        })
    }

    /// Binds Gaussians given in the template's space: `triangles` and `barycentrics` say which point of the mesh each is bound to, and the
    /// local offset and rotation are computed.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn bind(
        template: &Template,
        gaussians: &GaussianSet,
        triangles: Vec<u32>,
        barycentrics: Vec<[f32; 2]>,
    ) -> Result<Self, PersonError> {
        let count = gaussians.len();
        PersonError::check_count("Gaussian triangles", triangles.len(), count)?;
        PersonError::check_count("barycentrics", barycentrics.len(), count)?;
        let faces = template.faces();
        PersonError::check_indices(
            "Gaussian triangle",
            triangles.iter().map(|t| *t as usize),
            faces.len(),
        )?;
        let mut attributes = vec![0.0; ATTRIBUTES * count];
        for i in 0..count {
            let [a, b, c] = faces[triangles[i] as usize].map(|v| template.vertices()[v as usize]);
            let world_from_local = triangle_frame([a, b, c]);
            let anchor = barycentric_point(a, b, c, barycentrics[i]);
            let offset = world_from_local.transpose() * (gaussians.positions[i] - anchor);
            let rotation = Quat::from_mat3(&world_from_local).conjugate() * gaussians.rotations[i];
            let values = offset
                .to_array()
                .into_iter()
                .chain(rotation.to_array())
                .chain(gaussians.log_scales[i].to_array())
                .chain([gaussians.opacity_logits[i]])
                .chain(gaussians.colours[i].to_array());
            for (plane, value) in values.enumerate() {
                attributes[plane * count + i] = value;
            }
        }
        Self::new(template, triangles, barycentrics, attributes)
    }

    /// These Gaussians as an avatar package keeps them: attributes and barycentrics rounded to half precision, standard deviations held at
    /// [`crate::MOST_SCALE`].
    ///
    /// The relative error is 2^-11: 0.0005 of a 1 mm offset, 0.0025 of a log-scale of -5, 10 um on a 2 cm edge. Fit
    /// networks against the rounded Gaussians, so that they see what the receiver sees.
    #[must_use]
    pub fn quantised(mut self) -> Self {
        let round = |value: &mut f32| *value = f16::from_f32(*value).to_f32();
        let count = self.len();
        let scales = attribute::LOG_SCALE.start * count..attribute::LOG_SCALE.end * count;
        if let Some(scales) = self.attributes.get_mut(scales) {
            (scales.iter_mut()).for_each(|value| *value = held_log_scale(*value));
        }
        self.attributes.iter_mut().for_each(round);
        self.barycentrics
            .as_flattened_mut()
            .iter_mut()
            .for_each(round);
        self
    }

    /// Number of Gaussians N_g.
    #[must_use]
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// `[N_g]` triangle of the template each Gaussian is bound to.
    #[must_use]
    pub fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// `[N_g]` vertex indices of those triangles.
    #[must_use]
    pub fn corners(&self) -> &[[u32; 3]] {
        &self.corners
    }

    /// `[N_g]` barycentric weights of the second and third corner; the first has the rest.
    #[must_use]
    pub fn barycentrics(&self) -> &[[f32; 2]] {
        &self.barycentrics
    }

    /// The 14 attribute planes, row-major [14, N_g], in the triangles' frames.
    #[must_use]
    pub fn attributes(&self) -> &[f32] {
        &self.attributes
    }

    /// F_m2g plus F_attr: the Gaussians of one frame.
    ///
    /// `posed` is the deform graph's mesh, `residuals` its [14, N_g] output (`None`: the mesh alone drives), `root` the
    /// root translation in metres. Writes every Gaussian of `out` and allocates nothing.
    ///
    /// # Errors
    /// If the sizes of `posed`, `residuals` or `out` are not this binding's.
    pub fn pose(
        &self,
        posed: PlanarVertices<'_>,
        residuals: Option<&[f32]>,
        root: Vec3,
        out: &mut GaussianSet,
    ) -> Result<(), PersonError> {
        let count = self.len();
        PersonError::check_count("posed vertices", posed.x.len(), self.vertices)?;
        PersonError::check_count("output Gaussians", out.len(), count)?;
        if let Some(residuals) = residuals {
            PersonError::check_count("residuals", residuals.len(), ATTRIBUTES * count)?;
        }
        let planes = Planes {
            template: &self.attributes,
            residuals,
            count,
        };
        (
            out.positions.par_chunks_mut(CHUNK),
            out.rotations.par_chunks_mut(CHUNK),
            out.log_scales.par_chunks_mut(CHUNK),
            out.opacity_logits.par_chunks_mut(CHUNK),
            out.colours.par_chunks_mut(CHUNK),
        )
            .into_par_iter()
            .enumerate()
            .for_each(
                |(chunk, (positions, rotations, log_scales, opacity_logits, colours))| {
                    for k in 0..positions.len() {
                        let i = chunk * CHUNK + k;
                        let [a, b, c] = self.corners[i].map(|v| posed.get(v));
                        let world_from_local = triangle_frame([a, b, c]);
                        let offset = planes.vec3(attribute::OFFSET.start, i);
                        positions[k] = barycentric_point(a, b, c, self.barycentrics[i])
                            + world_from_local * offset
                            + root;
                        rotations[k] =
                            (Quat::from_mat3(&world_from_local) * planes.quat(i)).normalize();
                        log_scales[k] = planes.vec3(attribute::LOG_SCALE.start, i);
                        opacity_logits[k] = planes.get(attribute::OPACITY, i);
                        colours[k] = planes.vec3(attribute::COLOUR.start, i);
                    }
                },
            );
        Ok(())
    }
}

/// Template attributes plus residuals, read as one.
struct Planes<'a> {
    template: &'a [f32],
    residuals: Option<&'a [f32]>,
    count: usize,
}

impl Planes<'_> {
    fn get(&self, plane: usize, i: usize) -> f32 {
        let at = plane * self.count + i;
        self.template[at] + self.residuals.map_or(0.0, |r| r[at])
    }

    fn vec3(&self, plane: usize, i: usize) -> Vec3 {
        Vec3::new(
            self.get(plane, i),
            self.get(plane + 1, i),
            self.get(plane + 2, i),
        )
    }

    /// A sum of quaternions need not have unit length: it is normalised, and the identity where the sum is zero.
    fn quat(&self, i: usize) -> Quat {
        let p = attribute::ROTATION.start;
        let q = Quat::from_xyzw(
            self.get(p, i),
            self.get(p + 1, i),
            self.get(p + 2, i),
            self.get(p + 3, i),
        );
        if q.length_squared() > 1e-12 {
            q.normalize()
        } else {
            Quat::IDENTITY
        }
    }
}

fn barycentric_point(a: Vec3, b: Vec3, c: Vec3, [v, w]: [f32; 2]) -> Vec3 {
    a + (b - a) * v + (c - a) * w
}

/// A triangle's own frame as the columns of `world_from_local`: x along the edge from `a` to `b`, z along the
/// counter-clockwise normal, y = z cross x in the triangle's plane. The origin is whatever the caller puts there: for a
/// Gaussian its barycentric anchor.
///
/// Offsets, rotations and the network's residuals are all in this frame, so a program that fits them must use this
/// very function. A collapsed triangle gets some orthonormal frame, so that its Gaussians stay finite.
#[must_use]
pub fn triangle_frame([a, b, c]: [Vec3; 3]) -> Mat3 {
    let x = (b - a).try_normalize().unwrap_or(Vec3::X);
    let normal = x
        .cross(c - a)
        .try_normalize()
        .unwrap_or_else(|| x.any_orthonormal_vector());
    Mat3::from_cols(x, normal.cross(x), normal)
}

/// A log-scale as a package keeps it: that of a builder's floater is held at the largest there may be.
fn held_log_scale(log_scale: f32) -> f32 {
    log_scale.min(MOST_SCALE.ln())
}
