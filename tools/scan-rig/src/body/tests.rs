//! The body model on the real package, which `MON3TR_MAKEHUMAN` names, and registrations of bodies whose pose is known.

use super::derivatives::Derivatives;
use super::landmarks::{Place, Source, Targets};
use super::laplacian::{Laplacian, Pulled};
use super::model::Neighbours;
use super::state::{Posed, SCALE, SHAPES, State, TURNED, TURNS};
use super::{BodyModel, BodyPart, Hint, Observed, posing, register};
use crate::normals::vertex_normals;
use crate::points::KeyPoint;
use glam::{DMat3, DVec3, Vec3};
use motion_fit::landmarks::BODY_LANDMARKS;
use nalgebra::{DMatrix, DVector};
use spmm3::{JOINTS, Joint};
use std::path::PathBuf;
use std::sync::OnceLock;

/// The model, built once; `None` (said aloud) on a machine without the package.
fn model() -> Option<&'static BodyModel> {
    static MODEL: OnceLock<Option<BodyModel>> = OnceLock::new();
    MODEL
        .get_or_init(|| {
            let found = std::env::var_os("MON3TR_MAKEHUMAN").map(PathBuf::from);
            if found.is_none() {
                let ci = std::env::var("CI").as_deref() == Ok("true");
                assert!(!ci, "MON3TR_MAKEHUMAN must name the MakeHuman data in CI");
                eprintln!("skipped: MON3TR_MAKEHUMAN does not name the MakeHuman data");
            }
            found.map(|path| BodyModel::load(&path).expect("the package is whole"))
        })
        .as_ref()
}

/// Somebody who is not the average, and does not stand as the rest pose does.
fn somebody(model: &BodyModel) -> State {
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

/// What a perfect observer sees of a pose: landmarks and the middle of each outer face.
fn seen(
    model: &BodyModel,
    state: &State,
) -> (
    [KeyPoint; BODY_LANDMARKS],
    Vec<Vec3>,
    Vec<Vec3>,
    [DVec3; JOINTS],
) {
    let (vertices, joints) = skinned_by_hand(model, state);
    let anywhere = [KeyPoint {
        position: DVec3::ZERO,
        residual: 0.01,
        support: 9.0,
    }; BODY_LANDMARKS];
    let mut points = anywhere;
    for target in Targets::new(model, &anywhere, &[], &[]).all {
        let Source::Body(landmark) = target.source else {
            continue;
        };
        let carried = state.rotations[target.carrier.index()] * target.offset * state.scale;
        points[landmark].position = carried
            + match target.place {
                Place::Joint(joint) => joints[joint.index()],
                Place::Vertex(vertex) => vertices[vertex],
            };
    }
    let (mut middles, mut outwards) = (Vec::new(), Vec::new());
    for face in &model.faces {
        if face
            .iter()
            .all(|v| (*v as usize) < model.body_vertices && model.outer[*v as usize])
        {
            let [a, b, c] = face.map(|v| vertices[v as usize]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            if normal != DVec3::ZERO {
                middles.push(((a + b + c) / 3.0).as_vec3());
                outwards.push(normal.as_vec3());
            }
        }
    }
    (points, middles, outwards, joints)
}

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
    let state = somebody(model);
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
fn the_derivatives_are_those_of_small_steps() {
    let Some(model) = model() else { return };
    let state = somebody(model);
    let posed = Posed::new(model, &state);
    let derivatives = Derivatives::new(model, &state, &posed);
    let mut row = vec![0.0; state.unknowns()];
    let direction = DVec3::new(0.5, -0.7, 0.4);
    let vertices = [454, 3000, 7000, 11_000];
    for at in [
        0,
        SCALE,
        TURNS + 1,
        TURNS + 3 * 14 + 2,
        TURNS + 3 * 13,
        SHAPES,
        SHAPES + 9,
    ] {
        let mut step = DVector::zeros(state.unknowns());
        step[at] = 1e-6;
        let mut there = state.clone();
        there.step(&step);
        step[at] = -1e-6;
        let mut back = state.clone();
        back.step(&step);
        let (there, back) = (Posed::new(model, &there), Posed::new(model, &back));
        for vertex in vertices {
            derivatives.of_vertex(vertex, direction, &mut row);
            let moved = (there.vertices[vertex] - back.vertices[vertex]).dot(direction) / 2e-6;
            assert!(
                (row[at] - moved).abs() < 1e-5,
                "vertex {vertex}, unknown {at}: {} is not {moved}",
                row[at]
            );
        }
        let joint = Joint::LeftWrist;
        derivatives.of_joint(joint, direction, &mut row);
        let moved = there.joints[joint.index()] - back.joints[joint.index()];
        let moved = moved.dot(direction) / 2e-6;
        assert!((row[at] - moved).abs() < 1e-5, "the wrist, unknown {at}");
    }
    assert_eq!(TURNED.len(), 20, "turned joints");
}

#[test]
fn the_smoothest_displacement_is_that_of_a_dense_solver() {
    // A strip of quads, pulled at both ends.
    let rings: Vec<[u32; 4]> = (0..9)
        .map(|k| [2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2])
        .collect();
    let neighbours = Neighbours::new(20, &rings);
    let stiffness: Vec<f64> = (0..20).map(|v| 1.0 + 0.3 * f64::from(v % 3)).collect();
    let mut pulled = vec![Pulled::default(); 20];
    for (v, towards) in [
        (0, DVec3::X),
        (1, DVec3::Z),
        (19, DVec3::new(0.0, 2.0, -1.0)),
    ] {
        pulled[v].every_way = 3.0;
        pulled[v].towards = 3.0 * towards;
    }
    pulled[10].normal = DVec3::Y;
    pulled[10].along = 2.0;
    pulled[10].towards = DVec3::Y * -1.0;
    let mut found = vec![DVec3::ZERO; 20];
    Laplacian::new(&neighbours, stiffness.clone()).solve(1.7, &pulled, &mut found);
    let mut laplacian = DMatrix::<f64>::identity(20, 20);
    for v in 0..20 {
        let near = neighbours.of(v);
        for n in near {
            laplacian[(v, *n as usize)] = -1.0 / f64::from(neighbours.count(v));
        }
        assert!(near.len() >= 2, "vertex {v} has {} neighbours", near.len());
    }
    let weights = DMatrix::from_diagonal(&DVector::from_vec(stiffness));
    let smooth = laplacian.transpose() * weights * laplacian * 1.7;
    let mut whole = DMatrix::<f64>::zeros(60, 60);
    let mut right = DVector::<f64>::zeros(60);
    for v in 0..20 {
        for axis in 0..3 {
            for n in 0..20 {
                whole[(3 * v + axis, 3 * n + axis)] += smooth[(v, n)];
            }
            whole[(3 * v + axis, 3 * v + axis)] += 0.002 + pulled[v].every_way;
            right[3 * v + axis] = pulled[v].towards[axis];
            for other in 0..3 {
                let normal = pulled[v].normal;
                whole[(3 * v + axis, 3 * v + other)] +=
                    pulled[v].along * normal[axis] * normal[other];
            }
        }
    }
    let exact = whole.lu().solve(&right).expect("not singular");
    for v in 0..20 {
        for axis in 0..3 {
            let (a, b) = (found[v][axis], exact[3 * v + axis]);
            assert!(
                (a - b).abs() < 1e-3,
                "vertex {v}, axis {axis}: {a} is not {b}"
            );
        }
    }
}

#[test]
fn a_body_seen_perfectly_is_found() {
    let Some(model) = model() else { return };
    let state = somebody(model);
    let (points, middles, outwards, joints) = seen(model, &state);
    let observed = Observed {
        body: &points,
        face: None,
        points: &middles,
        normals: &outwards,
        hints: &[],
    };
    let (found, report) = register(model, &observed).expect("a body");
    let errors: Vec<f64> = (0..22)
        .map(|j| 1e3 * found.joints[j].distance(joints[j]))
        .collect();
    let mean = errors.iter().sum::<f64>() / 22.0;
    let worst = errors.iter().copied().fold(0.0, f64::max);
    assert!(
        mean < 8.0 && worst < 20.0,
        "joints {mean:.1} mm off, at most {worst:.1}"
    );
    assert!(
        report.displaced < 0.001,
        "{} m from the surface",
        report.displaced
    );
    assert!(report.warnings.is_empty(), "{:?}", report.warnings);
    assert!(
        found.confidence[..22].iter().all(|sure| *sure > 0.5),
        "{:?}",
        found.confidence
    );
    let again = register(model, &observed).expect("a body").0;
    assert_eq!(
        again.vertices, found.vertices,
        "another result the second time"
    );
}

#[test]
fn a_wrong_landmark_is_told_and_a_hint_heals_it() {
    let Some(model) = model() else { return };
    let state = somebody(model);
    let (mut points, middles, outwards, joints) = seen(model, &state);
    // The left wrist and fingers were seen elsewhere, with rays that miss one another; the forearm was not scanned.
    for landmark in [15, 17, 19] {
        points[landmark].position += DVec3::new(0.05, -0.06, -0.12);
        points[landmark].residual = 0.045;
    }
    let wrist = joints[Joint::LeftWrist.index()];
    let (middles, outwards): (Vec<Vec3>, Vec<Vec3>) = (middles.into_iter().zip(outwards))
        .filter(|(p, _)| p.as_dvec3().distance(wrist) > 0.2)
        .unzip();
    let mut observed = Observed {
        body: &points,
        face: None,
        points: &middles,
        normals: &outwards,
        hints: &[],
    };
    let at = Joint::LeftWrist.index();
    let (wrong, report) = register(model, &observed).expect("a body");
    let off = wrong.joints[at].distance(wrist);
    assert!(off > 0.03, "the wrist is only {off} m off");
    assert!(
        wrong.confidence[at] < 0.5,
        "sure of it: {}",
        wrong.confidence[at]
    );
    let told = report
        .warnings
        .iter()
        .find(|w| w.contains("--joint left_wrist=x,y,z"));
    assert!(told.is_some(), "{:?}", report.warnings);
    let hints = [Hint {
        joint: Joint::LeftWrist,
        position: wrist,
    }];
    observed.hints = &hints;
    let (right, _) = register(model, &observed).expect("a body");
    let off = right.joints[at].distance(wrist);
    assert!(off < 0.01, "with the hint the wrist is {off} m off");
    assert!(
        right.confidence[at] > 0.5,
        "unsure of a hint: {}",
        right.confidence[at]
    );
}

#[test]
fn what_is_no_number_or_missing_is_survived_or_refused() {
    let Some(model) = model() else { return };
    let state = somebody(model);
    let (mut points, mut middles, mut outwards, _) = seen(model, &state);
    points[13].position = DVec3::NAN;
    points[14].support = 0.0;
    points[0].residual = f64::INFINITY;
    middles[7] = Vec3::NAN;
    outwards[9] = Vec3::INFINITY;
    let observed = Observed {
        body: &points,
        face: None,
        points: &middles,
        normals: &outwards,
        hints: &[],
    };
    let (found, _) = register(model, &observed).expect("a body");
    assert!(
        found.vertices.iter().all(|v| v.is_finite()),
        "vertices that are no numbers"
    );
    let none = Observed {
        points: &[],
        normals: &[],
        ..observed
    };
    let (found, _) = register(model, &none).expect("a body by its landmarks alone");
    assert!(
        found.vertices.iter().all(|v| v.is_finite()),
        "without a surface"
    );
    let mut halved = points;
    halved[23].support = 0.0;
    let half = Observed {
        body: &halved,
        ..none
    };
    assert!(register(model, &half).is_err(), "a person without a hip");
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
