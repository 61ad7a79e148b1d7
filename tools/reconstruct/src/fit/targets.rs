//! The targets of F_attr: for each Gaussian and pose the difference between its true attributes and those that the
//! predicted mesh gives it, in the predicted triangle's frame.

use crate::simulate::{Creases, Fabric, Puppet, Surface};
use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use spmm3::{ATTRIBUTES, BoundGaussians, MotionParams, SH_C0, attribute, triangle_frame};

/// How far Gaussians follow the smooth surface that the vertex normals suggest (Phong tessellation, Boubekeur 2008).
const ROUNDNESS: f32 = 0.6;
/// Bounds of a residual: beyond them a triangle has collapsed, and nothing sensible can be learned.
const MAX_OFFSET: f32 = 0.03;
const MAX_LOG_SCALE: f32 = 0.5;
const MAX_TURN: f32 = 1.0;

/// One pose's meshes and light.
#[derive(Debug, Clone)]
pub struct Frame {
    /// Posed vertices as the networks' mesh gives them, metres, `[N_v]`.
    pub predicted: Vec<Vec3>,
    /// Posed vertices as simulated, metres, `[N_v]`.
    pub truth: Vec<Vec3>,
    /// Unit normals of the simulated mesh, `[N_v]`.
    pub normals: Vec<Vec3>,
    /// Light factors on the simulated mesh, red, green and blue, `[N_v]`.
    pub light: Vec<Vec3>,
    /// Folds of this pose.
    pub creases: Creases,
}

impl Frame {
    /// Completes a pose whose meshes are known.
    #[must_use]
    pub fn new(
        puppet: &Puppet,
        surface: &Surface,
        motion: &MotionParams,
        predicted: Vec<Vec3>,
        truth: Vec<Vec3>,
        light: Vec<Vec3>,
    ) -> Self {
        Self {
            normals: surface.normals(&truth),
            creases: Creases::new(&puppet.skeleton, motion),
            predicted,
            truth,
            light,
        }
    }
}

/// A Gaussian's attributes at rest.
#[derive(Debug, Clone, Copy)]
struct Rest {
    corners: [usize; 3],
    shares: [f32; 3],
    /// In-plane edges of the rest triangle in its own frame: x of the first; x and y of the second.
    edges: [f32; 3],
    offset: Vec3,
    rotation: Quat,
    colour: Vec3,
    albedo: Vec3,
    bulge: f32,
    anchor: Vec3,
    folds: bool,
}

/// Computes residuals of any Gaussian in any frame.
#[derive(Debug)]
pub struct Targets {
    rest: Vec<Rest>,
}

impl Targets {
    /// `albedo` is each Gaussian's unlit colour, sRGB 0..=1, `[N_g]`.
    #[must_use]
    pub fn new(
        puppet: &Puppet,
        surface: &Surface,
        gaussians: &BoundGaussians,
        albedo: &[Vec3],
    ) -> Self {
        let points = puppet.template.vertices();
        let normals = surface.normals(points);
        let count = gaussians.len();
        let plane = |p: usize, i: usize| gaussians.attributes()[p * count + i];
        let vec3 = |p: usize, i: usize| Vec3::new(plane(p, i), plane(p + 1, i), plane(p + 2, i));
        let rest = (0..count)
            .into_par_iter()
            .map(|i| {
                let corners = gaussians.corners()[i].map(|v| v as usize);
                let [v, w] = gaussians.barycentrics()[i];
                let shares = [1.0 - v - w, v, w];
                let frame = triangle_frame(corners.map(|c| points[c]));
                let (first, second) = (
                    points[corners[1]] - points[corners[0]],
                    points[corners[2]] - points[corners[0]],
                );
                let q = attribute::ROTATION.start;
                Rest {
                    corners,
                    shares,
                    edges: [
                        first.length(),
                        second.dot(frame.x_axis),
                        second.dot(frame.y_axis),
                    ],
                    offset: vec3(attribute::OFFSET.start, i),
                    rotation: Quat::from_xyzw(
                        plane(q, i),
                        plane(q + 1, i),
                        plane(q + 2, i),
                        plane(q + 3, i),
                    ),
                    colour: vec3(attribute::COLOUR.start, i),
                    albedo: albedo[i],
                    bulge: phong(corners, shares, points, &normals, frame.z_axis),
                    anchor: mix(corners, shares, points),
                    folds: corners.iter().all(|c| puppet.fabric[*c] == Fabric::Cloth),
                }
            })
            .collect();
        Self { rest }
    }

    /// Number of Gaussians.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// The 14 residuals of Gaussian `i` in `frame`, in the order of the attribute planes.
    #[must_use]
    pub fn residual(&self, i: usize, frame: &Frame) -> [f32; ATTRIBUTES] {
        let rest = &self.rest[i];
        let corners = rest.corners;
        let predicted = corners.map(|c| frame.predicted[c]);
        let local_from_world = triangle_frame(predicted).transpose();
        let truth = corners.map(|c| frame.truth[c]);
        let true_frame = triangle_frame(truth);

        // Place: the true surface's, rounder where it bends more than at rest, plus the fine folds.
        let bulge = phong(
            corners,
            rest.shares,
            &frame.truth,
            &frame.normals,
            true_frame.z_axis,
        ) - rest.bulge;
        let fold = if rest.folds {
            frame.creases.fold(rest.anchor)
        } else {
            0.0
        };
        let lifted = rest.offset + Vec3::Z * (ROUNDNESS * bulge + fold);
        let place = mix(corners, rest.shares, &frame.truth) + true_frame * lifted;
        let anchor = mix(corners, rest.shares, &frame.predicted);
        let offset =
            (local_from_world * (place - anchor) - rest.offset).clamp_length_max(MAX_OFFSET);

        // Shape: the triangle's in-plane stretch, as a turn and a stretch of each axis.
        let (first, second) = (truth[1] - truth[0], truth[2] - truth[0]);
        let [e, fx, fy] = rest.edges;
        let stretch = first.length() / e.max(1e-6);
        let column = [
            (second.dot(true_frame.x_axis) - stretch * fx) / fy.max(1e-6),
            second.dot(true_frame.y_axis) / fy.max(1e-6),
        ];
        let turn = (-column[0])
            .atan2(stretch + column[1])
            .clamp(-MAX_TURN, MAX_TURN);
        let map = Mat3::from_cols(
            Vec3::X * stretch,
            Vec3::new(column[0], column[1], 0.0),
            Vec3::Z,
        );
        let axes = Mat3::from_quat(rest.rotation);
        let longer = |axis: Vec3| {
            (map * axis)
                .length()
                .max(1e-3)
                .ln()
                .clamp(-MAX_LOG_SCALE, MAX_LOG_SCALE)
        };
        let predicted_from_true = Quat::from_mat3(&(local_from_world * true_frame));
        let mut rotation = predicted_from_true * Quat::from_rotation_z(turn) * rest.rotation;
        if rotation.dot(rest.rotation) < 0.0 {
            rotation = -rotation;
        }

        let light = mix(corners, rest.shares, &frame.light) * Creases::fold_light(fold);
        let colour =
            ((rest.albedo * light).clamp(Vec3::ZERO, Vec3::ONE) - 0.5) / SH_C0 - rest.colour;

        let mut out = [0.0; ATTRIBUTES];
        out[attribute::OFFSET].copy_from_slice(&offset.to_array());
        let turned: [f32; 4] = (rotation - rest.rotation).to_array();
        out[attribute::ROTATION].copy_from_slice(&turned);
        let scale = [
            longer(axes.x_axis),
            longer(axes.y_axis),
            longer(axes.z_axis),
        ];
        out[attribute::LOG_SCALE].copy_from_slice(&scale);
        out[attribute::COLOUR].copy_from_slice(&colour.to_array());
        out
    }

    /// Residuals of all Gaussians in one frame, row-major `[14, N_g]`.
    #[must_use]
    pub fn planes(&self, frame: &Frame) -> Vec<f32> {
        let rows: Vec<[f32; ATTRIBUTES]> = (0..self.len())
            .into_par_iter()
            .map(|i| self.residual(i, frame))
            .collect();
        (0..ATTRIBUTES)
            .flat_map(|plane| rows.iter().map(move |row| row[plane]))
            .collect()
    }
}

fn mix(corners: [usize; 3], shares: [f32; 3], values: &[Vec3]) -> Vec3 {
    values[corners[0]] * shares[0] + values[corners[1]] * shares[1] + values[corners[2]] * shares[2]
}

/// Height of the Phong-tessellated surface over the flat triangle along `up`, metres.
fn phong(
    corners: [usize; 3],
    shares: [f32; 3],
    points: &[Vec3],
    normals: &[Vec3],
    up: Vec3,
) -> f32 {
    let flat = mix(corners, shares, points);
    corners
        .iter()
        .zip(shares)
        .map(|(c, share)| share * (points[*c] - flat).dot(normals[*c]) * normals[*c].dot(up))
        .sum()
}
