//! A captured pose on a skeleton: corrections of it, the joints' maps from T-pose, and how vertices move with corrections and shape.

use crate::body::{Body, Field};
use capture::FramePose;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use rayon::prelude::*;
use scan_rig::body::posing;
use scan_rig::body::state::TURNED;
use spmm3::{JOINTS, Joint, MotionParams, SkinWeights};

/// Numbers of a correction: the pelvis' shift, and a turn for each of [`TURNED`].
pub(crate) const CORRECTION: usize = 3 + 3 * TURNED.len();

/// What is added to a captured pose, small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Correction {
    /// Shift of the pelvis joint along the axes of the pelvis, metres.
    pub(crate) pelvis: DVec3,
    /// Turns of [`TURNED`] as axis times angle, radians, in the axes of the joint's parent (the pelvis: in its own).
    pub(crate) turns: [DVec3; TURNED.len()],
}

impl Default for Correction {
    fn default() -> Self {
        Self {
            pelvis: DVec3::ZERO,
            turns: [DVec3::ZERO; TURNED.len()],
        }
    }
}

impl Correction {
    /// All numbers in order.
    pub(crate) fn values(&self) -> [f64; CORRECTION] {
        let all = std::iter::once(self.pelvis).chain(self.turns);
        let mut values = [0.0; CORRECTION];
        for (slot, value) in values.iter_mut().zip(all.flat_map(|v| v.to_array())) {
            *slot = value;
        }
        values
    }

    /// Adds a step, each part of it bounded.
    pub(crate) fn step(&mut self, step: &[f64]) {
        let triple = |at: usize| {
            let part = |k: usize| step.get(at + k).copied().unwrap_or(0.0);
            DVec3::new(part(0), part(1), part(2))
        };
        self.pelvis += triple(0).clamp_length_max(0.1);
        for (at, turn) in self.turns.iter_mut().enumerate() {
            *turn += triple(3 + 3 * at).clamp_length_max(0.2);
        }
    }

    pub(crate) fn plus(&self, other: &Self) -> Self {
        Self {
            pelvis: self.pelvis + other.pelvis,
            turns: std::array::from_fn(|k| self.turns[k] + other.turns[k]),
        }
    }

    fn turn(&self, joint: Joint) -> Option<DQuat> {
        let at = TURNED.iter().position(|turned| *turned == joint)?;
        Some(DQuat::from_scaled_axis(self.turns[at]))
    }
}

/// The joints' rotations relative to their parents, corrected.
fn local(pose: &FramePose, correction: &Correction, joint: Joint) -> DQuat {
    let given = DQuat::from_scaled_axis(pose.parameters.axis_angle(joint).as_dvec3());
    match (correction.turn(joint), joint.parent()) {
        (None, _) => given,
        (Some(turn), None) => given * turn,
        (Some(turn), Some(_)) => turn * given,
    }
}

/// The motion parameters of a corrected pose; `rest_pelvis` is the pelvis joint of the avatar's skeleton, metres.
pub(crate) fn motion(
    pose: &FramePose,
    correction: &Correction,
    rest_pelvis: DVec3,
) -> MotionParams {
    let corrected = corrected(pose, correction);
    let mut motion = corrected.parameters;
    motion.root_translation = (corrected.pelvis.as_dvec3() - rest_pelvis).as_vec3();
    motion
}

/// A corrected pose as a capture has it.
pub(crate) fn corrected(pose: &FramePose, correction: &Correction) -> FramePose {
    let mut parameters = pose.parameters.clone();
    for joint in TURNED {
        let turned = local(pose, correction, joint).normalize();
        parameters.set_rotation(joint, turned.as_quat());
    }
    let turned = local(pose, correction, Joint::Pelvis);
    let pelvis = pose.pelvis.as_dvec3() + turned * correction.pelvis;
    FramePose {
        parameters,
        pelvis: pelvis.as_vec3(),
    }
}

/// A skeleton in a pose in the world.
#[derive(Debug, Clone)]
pub(crate) struct Posed {
    /// World rotations relative to the T-pose.
    pub(crate) rotations: [DMat3; JOINTS],
    /// Metres.
    pub(crate) joints: [DVec3; JOINTS],
    /// Each joint's map from T-pose to the world.
    pub(crate) maps: [DAffine3; JOINTS],
}

impl Posed {
    /// `joints`: those of the body in T-pose, metres.
    pub(crate) fn new(joints: &[DVec3; JOINTS], pose: &FramePose, correction: &Correction) -> Self {
        let mut turns = [DQuat::IDENTITY; JOINTS];
        for joint in Joint::ALL {
            let own = local(pose, correction, joint);
            turns[joint.index()] = joint
                .parent()
                .map_or(own, |parent| turns[parent.index()] * own);
        }
        let rotations = turns.map(|turn| DMat3::from_quat(turn.normalize()));
        let pelvis = pose.pelvis.as_dvec3() + rotations[0] * correction.pelvis;
        let posed = posing::chain(&rotations, pelvis, 1.0, joints);
        Self {
            maps: posing::posed_from_rest(&rotations, &posed, 1.0, joints),
            joints: posed,
            rotations,
        }
    }

    /// A row of weights' map from T-pose to the world.
    pub(crate) fn map(&self, skin: &SkinWeights) -> DAffine3 {
        let mut sum = DAffine3 {
            matrix3: DMat3::ZERO,
            translation: DVec3::ZERO,
        };
        for (joint, weight) in influences(skin) {
            sum.matrix3 += self.maps[joint].matrix3 * weight;
            sum.translation += self.maps[joint].translation * weight;
        }
        sum
    }

    /// `[N_v]` vertices in the world, metres, of those in T-pose.
    pub(crate) fn vertices(&self, skin: &[SkinWeights], tpose: &[DVec3]) -> Vec<DVec3> {
        (skin.par_iter().zip(tpose))
            .map(|(skin, vertex)| self.map(skin).transform_point3(*vertex))
            .collect()
    }

    /// The axes in which a turn of [`TURNED`] number `at` is given.
    fn axes(&self, at: usize) -> &DMat3 {
        let joint = TURNED[at];
        &self.rotations[joint.parent().unwrap_or(joint).index()]
    }
}

/// The joints that move a vertex, and their weights.
pub(crate) fn influences(skin: &SkinWeights) -> impl Iterator<Item = (usize, f64)> {
    (skin.joints.into_iter().zip(skin.weights))
        .filter(|(joint, weight)| *weight > 0.0 && usize::from(*joint) < JOINTS)
        .map(|(joint, weight)| (usize::from(joint), f64::from(weight)))
}

/// How vertices move with a correction and with fields: what all rows of the Jacobian in one pose share.
#[derive(Debug)]
pub(crate) struct Derivatives<'a> {
    body: &'a Body,
    posed: &'a Posed,
    fields: &'a [Field],
    /// `[55][fields]` how a joint's flesh moves with the field, the vertex' own offset left out.
    flesh: Vec<Vec<DVec3>>,
}

impl<'a> Derivatives<'a> {
    pub(crate) fn new(body: &'a Body, posed: &'a Posed, fields: &'a [Field]) -> Self {
        let mut moved = vec![vec![DVec3::ZERO; fields.len()]; JOINTS];
        let mut flesh = moved.clone();
        for (at, field) in fields.iter().enumerate() {
            for joint in Joint::ALL {
                let here = joint.index();
                if let Some(parent) = joint.parent() {
                    let from = parent.index();
                    let bone = field.joints[here] - field.joints[from];
                    moved[here][at] = moved[from][at] + posed.rotations[from] * bone;
                }
                flesh[here][at] = moved[here][at] - posed.rotations[here] * field.joints[here];
            }
        }
        Self {
            body,
            posed,
            fields,
            flesh,
        }
    }

    /// How many numbers a row has.
    pub(crate) fn unknowns(&self) -> usize {
        CORRECTION + self.fields.len()
    }

    /// Fills `row` with the derivatives of a vertex' place along `direction` (in the world); `tpose` is where it is in T-pose.
    pub(crate) fn of_vertex(&self, vertex: usize, tpose: DVec3, direction: DVec3, row: &mut [f64]) {
        row.fill(0.0);
        let shift = self.posed.rotations[0].transpose() * direction;
        row[..3].copy_from_slice(&shift.to_array());
        let mut blended = DMat3::ZERO;
        for (joint, weight) in influences(&self.body.skin[vertex]) {
            let map = &self.posed.maps[joint];
            blended += map.matrix3 * weight;
            let place = map.transform_point3(tpose);
            for carrier in &self.body.carriers[joint] {
                let arm = place - self.posed.joints[TURNED[*carrier].index()];
                let turn = self.posed.axes(*carrier).transpose() * arm.cross(direction) * weight;
                let slots = row[3 + 3 * carrier..].iter_mut();
                slots.zip(turn.to_array()).for_each(|(slot, t)| *slot += t);
            }
            for (slot, moved) in row[CORRECTION..].iter_mut().zip(&self.flesh[joint]) {
                *slot += weight * direction.dot(*moved);
            }
        }
        let in_tpose = blended.transpose() * direction;
        for (slot, field) in row[CORRECTION..].iter_mut().zip(self.fields) {
            *slot += in_tpose.dot(field.vertices[vertex]);
        }
    }
}
