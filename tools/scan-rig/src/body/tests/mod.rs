//! The body model on the real package, which `MON3TR_MAKEHUMAN` names, and registrations of bodies whose pose is known.

mod model;
mod registering;
mod solving;

use super::BodyModel;
use super::state::State;
use glam::{DMat3, DVec3};
use spmm3::{JOINTS, Joint};
use std::sync::OnceLock;
use synthetic_person::real_files::makehuman;

/// The model, built once; `None` (said aloud) on a machine without the package.
pub(crate) fn model() -> Option<&'static BodyModel> {
    static MODEL: OnceLock<Option<BodyModel>> = OnceLock::new();
    MODEL
        .get_or_init(|| {
            makehuman().map(|folder| BodyModel::load(&folder).expect("the package is whole"))
        })
        .as_ref()
}

/// A body that is not the average, and does not stand as the rest pose does.
fn posed_body(model: &BodyModel) -> State {
    let mut state = State::rest(model, DVec3::new(0.03, 0.95, -0.02));
    state.scale = 1.04;
    let mut shape = |name: &str, weight: f64| {
        let at = model.shapes.iter().position(|shape| shape.name == name);
        state.shape[at.expect("a shape of that name")] = weight;
    };
    shape("gender", -0.4);
    shape("weight", 0.3);
    shape("upperleg-scale-vert", 0.4);
    shape("torso/torso-scale-horiz", -0.3);
    for (joint, axis, degrees) in [
        (Joint::Pelvis, DVec3::Y, 8.0),
        (Joint::LeftShoulder, DVec3::Z, -25.0),
        (Joint::RightShoulder, DVec3::Z, 15.0),
        (Joint::LeftElbow, DVec3::X, -30.0),
        (Joint::RightHip, DVec3::X, -15.0),
        (Joint::RightKnee, DVec3::X, 20.0),
        (Joint::Head, DVec3::Y, -12.0),
    ] {
        state.turn(
            joint,
            DMat3::from_axis_angle(axis, f64::to_radians(degrees)),
        );
    }
    state
}

/// Linear blend skinning written out, joint by joint.
fn skinned_by_hand(model: &BodyModel, state: &State) -> (Vec<DVec3>, [DVec3; JOINTS]) {
    let mut rest = model.rest.clone();
    let mut rest_joints = model.joints;
    for (weight, shape) in state.shape.iter().zip(&model.shapes) {
        for (vertex, offset) in rest.iter_mut().zip(&shape.vertices) {
            *vertex += *weight * *offset;
        }
        for (joint, offset) in rest_joints.iter_mut().zip(&shape.joints) {
            *joint += *weight * *offset;
        }
    }
    let mut joints = [state.root; JOINTS];
    for j in Joint::ALL {
        if let Some(p) = j.parent() {
            let bone = rest_joints[j.index()] - rest_joints[p.index()];
            joints[j.index()] = joints[p.index()] + state.rotations[p.index()] * bone * state.scale;
        }
    }
    let vertices = (0..rest.len())
        .map(|v| {
            let carried = (0..JOINTS).map(|j| {
                let arm = (rest[v] - rest_joints[j]) * state.scale;
                f64::from(model.weights[v][j]) * (state.rotations[j] * arm + joints[j])
            });
            carried.sum()
        })
        .collect();
    (vertices, joints)
}
