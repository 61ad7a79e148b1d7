//! The model itself, and its poses.

use super::super::state::Posed;
use super::super::{BodyPart, posing};
use super::{model, posed_body, skinned_by_hand};
use crate::normals::vertex_normals;
use glam::DVec3;
use spmm3::Joint;

#[test]
fn the_model_is_makehumans_body_with_eyes_teeth_and_tongue() {
    let Some(model) = model() else { return };
    assert_eq!(model.body_vertices, 13_380, "the body's own vertices");
    assert_eq!(model.shapes.len(), 36, "shapes");
    assert_eq!(model.units.len(), 34, "expression units");
    let tall = |v: &[DVec3]| {
        let y = || v.iter().map(|v| v.y);
        y().fold(f64::NEG_INFINITY, f64::max) - y().fold(f64::INFINITY, f64::min)
    };
    let height = tall(&model.rest[..model.body_vertices]);
    assert!((height - 1.7185).abs() < 1e-3, "{height} m tall");
    for part in [
        BodyPart::InnerMouth,
        BodyPart::EyeSocket,
        BodyPart::Eyes,
        BodyPart::Teeth,
        BodyPart::Tongue,
        BodyPart::Hand,
    ] {
        assert!(model.parts.contains(&part), "no {part:?}");
    }
    for (row, v) in model.weights.iter().zip(0..) {
        let sum: f32 = row.iter().sum();
        assert!(
            (sum - 1.0).abs() < 1e-3,
            "weights of vertex {v} sum to {sum}"
        );
    }
    for face in &model.faces {
        let own = face
            .iter()
            .filter(|v| (**v as usize) < model.body_vertices)
            .count();
        assert!(own == 0 || own == 3, "a face joins the body and an eye");
    }
    let (basis, presets) = model.expressions();
    assert_eq!(basis.len(), 16, "coefficients");
    assert!(presets.contains_key("smile"), "no smile");
}

#[test]
fn the_t_pose_has_arms_along_x_and_straight_legs() {
    let Some(model) = model() else { return };
    let rotations = posing::t_pose(&model.joints);
    let joints = posing::chain(&rotations, DVec3::ZERO, 1.0, &model.joints);
    let bone = |from: Joint, to: Joint| (joints[to.index()] - joints[from.index()]).normalize();
    for (sign, shoulder, elbow, wrist, hip, knee, ankle, index, pinky) in [
        (
            1.0,
            Joint::LeftShoulder,
            Joint::LeftElbow,
            Joint::LeftWrist,
            Joint::LeftHip,
            Joint::LeftKnee,
            Joint::LeftAnkle,
            Joint::LeftIndex1,
            Joint::LeftPinky1,
        ),
        (
            -1.0,
            Joint::RightShoulder,
            Joint::RightElbow,
            Joint::RightWrist,
            Joint::RightHip,
            Joint::RightKnee,
            Joint::RightAnkle,
            Joint::RightIndex1,
            Joint::RightPinky1,
        ),
    ] {
        let out = DVec3::X * sign;
        assert!(
            bone(shoulder, elbow).dot(out) > 0.9999,
            "upper arm of {shoulder:?}"
        );
        assert!(bone(elbow, wrist).dot(out) > 0.9999, "forearm of {elbow:?}");
        assert!(bone(hip, knee).y < -0.999, "thigh of {hip:?}");
        assert!(bone(knee, ankle).y < -0.999, "shank of {knee:?}");
        assert!(bone(pinky, index).z > 0.8, "palm of {wrist:?}");
    }
    let vertices = posing::skinned(
        &model.weights,
        &posing::posed_from_rest(&rotations, &joints, 1.0, &model.joints),
        &model.rest,
    );
    let nose = vertices.iter().copied().max_by(|a, b| a.z.total_cmp(&b.z));
    assert!(
        nose.is_some_and(|nose| nose.z > 0.1),
        "the person does not face +z"
    );
}

#[test]
fn unskinning_undoes_skinning() {
    let Some(model) = model() else { return };
    let state = posed_body(model);
    let (by_hand, joints) = skinned_by_hand(model, &state);
    let posed = Posed::new(model, &state);
    let apart = (by_hand.iter().zip(&posed.vertices)).map(|(a, b)| a.distance(*b));
    assert!(
        apart.fold(0.0, f64::max) < 1e-5,
        "skinning differs from the reference"
    );
    let joints_apart = (joints.iter().zip(&posed.joints)).map(|(a, b)| a.distance(*b));
    assert!(
        joints_apart.fold(0.0, f64::max) < 1e-12,
        "joints differ from the reference"
    );
    let back = posing::unskinned(&model.weights, &posed.maps, &posed.vertices);
    let apart = (back.iter().zip(&posed.rest)).map(|(a, b)| a.distance(*b));
    assert!(
        apart.fold(0.0, f64::max) < 1e-9,
        "unskinning is not the inverse"
    );
}

#[test]
fn normals_of_the_model_point_outwards() {
    let Some(model) = model() else { return };
    let normals = vertex_normals(&model.rest, &model.faces, DVec3::ZERO);
    let chest = model.joints[Joint::Spine3.index()];
    let front = (0..model.body_vertices)
        .filter(|v| (model.rest[*v] - chest).reject_from(DVec3::Z).length() < 0.03)
        .max_by(|a, b| model.rest[*a].z.total_cmp(&model.rest[*b].z));
    assert!(
        front.is_some_and(|v| normals[v].z > 0.5),
        "the chest's normal points inwards"
    );
}
