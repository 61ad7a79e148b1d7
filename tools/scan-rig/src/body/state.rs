//! What the fit changes: place, size, pose and shape of the body model; and the model as they put it.

use super::model::{BodyModel, SkinRow};
use super::posing;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use nalgebra::DVector;
use spmm3::{JOINTS, Joint};

/// The joints that the fit turns; those below them go along.
pub const TURNED: [Joint; 20] = [
    Joint::Pelvis,
    Joint::LeftHip,
    Joint::RightHip,
    Joint::Spine1,
    Joint::LeftKnee,
    Joint::RightKnee,
    Joint::Spine2,
    Joint::LeftAnkle,
    Joint::RightAnkle,
    Joint::Spine3,
    Joint::Neck,
    Joint::LeftCollar,
    Joint::RightCollar,
    Joint::Head,
    Joint::LeftShoulder,
    Joint::RightShoulder,
    Joint::LeftElbow,
    Joint::RightElbow,
    Joint::LeftWrist,
    Joint::RightWrist,
];

/// Where in the vector of unknowns the scale's logarithm is; the translation comes before it.
pub(super) const SCALE: usize = 3;
/// Where the turns begin, three for each of [`TURNED`].
pub(super) const TURNS: usize = 4;
/// Where the shapes' weights begin.
pub(super) const SHAPES: usize = TURNS + 3 * TURNED.len();

/// How thick clothes usually are, metres, and at most.
pub(super) const USUAL_CLOTH: f64 = 0.006;
const MOST_CLOTH: f64 = 0.03;

/// The largest weight of a shape.
const MOST_SHAPE: f64 = 1.5;

/// Place, size, pose and shape.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Where the pelvis is, metres.
    pub root: DVec3,
    /// Uniform scale.
    pub scale: f64,
    /// World rotations relative to the model's rest pose.
    pub rotations: [DMat3; JOINTS],
    /// Weights of the model's shapes.
    pub shape: Vec<f64>,
    /// How thick clothes are, metres.
    pub cloth: f64,
}

impl State {
    /// The average body in the rest pose, its pelvis at `root`.
    #[must_use]
    pub fn rest(model: &BodyModel, root: DVec3) -> Self {
        Self {
            root,
            scale: 1.0,
            rotations: [DMat3::IDENTITY; JOINTS],
            shape: vec![0.0; model.shapes.len()],
            cloth: USUAL_CLOTH,
        }
    }

    /// How many unknowns there are.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.cloth_at() + 1
    }

    /// Where in the vector of unknowns the clothes' thickness is.
    pub(super) fn cloth_at(&self) -> usize {
        SHAPES + self.shape.len()
    }

    /// Adds a step of the fit, each part of it held within what the linear model is good for.
    pub(super) fn step(&mut self, step: &DVector<f64>) {
        let triple = |at: usize| DVec3::new(step[at], step[at + 1], step[at + 2]);
        self.root += triple(0);
        self.scale *= step[SCALE].clamp(-0.1, 0.1).exp();
        for (at, joint) in TURNED.into_iter().enumerate() {
            let turn = triple(TURNS + 3 * at).clamp(DVec3::splat(-0.4), DVec3::splat(0.4));
            self.turn(joint, DMat3::from_quat(DQuat::from_scaled_axis(turn)));
        }
        for (at, weight) in self.shape.iter_mut().enumerate() {
            let change = step[SHAPES + at].clamp(-0.5, 0.5);
            *weight = (*weight + change).clamp(-MOST_SHAPE, MOST_SHAPE);
        }
        let cloth = self.cloth + step[self.cloth_at()];
        self.cloth = cloth.clamp(0.0, MOST_CLOTH);
    }

    /// Turns a joint and all below it about itself, in the world.
    pub fn turn(&mut self, joint: Joint, turn: DMat3) {
        for below in Joint::ALL {
            if is_above(joint, below) {
                let rotation = &mut self.rotations[below.index()];
                *rotation = turn * *rotation;
            }
        }
    }

    /// The turn of a joint against its parent, as axis times angle in the parent's frame; zero for the pelvis.
    pub(super) fn bend(&self, joint: Joint) -> DVec3 {
        joint.parent().map_or(DVec3::ZERO, |parent| {
            let relative =
                self.rotations[parent.index()].transpose() * self.rotations[joint.index()];
            DQuat::from_mat3(&relative).to_scaled_axis()
        })
    }
}

/// Whether `joint` is `below` or one of the joints that carry it.
#[must_use]
pub fn is_above(joint: Joint, below: Joint) -> bool {
    let mut at = Some(below);
    while let Some(here) = at {
        if here == joint {
            return true;
        }
        at = here.parent();
    }
    false
}

/// The model as a state puts it.
#[derive(Debug, Clone)]
pub struct Posed {
    /// Joints in the rest pose of the shaped body, metres.
    pub rest_joints: [DVec3; JOINTS],
    /// `[N_v]` vertices in the rest pose of the shaped body, metres.
    pub rest: Vec<DVec3>,
    /// Joints, metres.
    pub joints: [DVec3; JOINTS],
    /// Each joint's map from rest.
    pub maps: [DAffine3; JOINTS],
    /// `[N_v]` vertices, metres.
    pub vertices: Vec<DVec3>,
}

impl Posed {
    /// Shapes and poses the model.
    #[must_use]
    pub fn new(model: &BodyModel, state: &State) -> Self {
        let (rest, rest_joints) = model.shaped(&state.shape);
        let joints = posing::chain(&state.rotations, state.root, state.scale, &rest_joints);
        let maps = posing::posed_from_rest(&state.rotations, &joints, state.scale, &rest_joints);
        Self {
            vertices: posing::skinned(&model.weights, &maps, &rest),
            rest_joints,
            rest,
            joints,
            maps,
        }
    }
}

/// The joints with a weight in a row, and the weights.
pub(super) fn influences(row: &SkinRow) -> impl Iterator<Item = (usize, f64)> {
    row.iter()
        .enumerate()
        .filter(|(_, weight)| **weight > 0.0)
        .map(|(joint, weight)| (joint, f64::from(*weight)))
}
