//! Registrations of bodies whose pose is known.

use super::super::landmarks::{Place, Source, Targets};
use super::super::posing::t_pose;
use super::super::state::State;
use super::super::{BodyModel, Hint, Observed, Registered, register};
use super::{model, posed_body, skinned_by_hand};
use crate::normals::vertex_normals;
use crate::points::KeyPoint;
use glam::{DMat3, DVec3, Vec3};
use motion_fit::landmarks::BODY_LANDMARKS;
use spmm3::{JOINTS, Joint};

/// The faces that can be seen, those of no area left out.
fn outer_faces(model: &BodyModel) -> impl Iterator<Item = [usize; 3]> {
    let is_outer = |v: usize| v < model.body_vertices && model.outer[v];
    let has_area = |[a, b, c]: [usize; 3]| {
        let [a, b, c] = [a, b, c].map(|v| model.rest[v]);
        (b - a).cross(c - a).length() > 1e-12
    };
    (model.faces.iter())
        .map(|face| face.map(|v| v as usize))
        .filter(move |face| face.iter().all(|v| is_outer(*v)) && has_area(*face))
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
    for face in outer_faces(model) {
        let [a, b, c] = face.map(|v| vertices[v]);
        middles.push(((a + b + c) / 3.0).as_vec3());
        outwards.push((b - a).cross(c - a).normalize().as_vec3());
    }
    (points, middles, outwards, joints)
}

#[test]
fn a_body_seen_perfectly_is_found() {
    let Some(model) = model() else { return };
    let state = posed_body(model);
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
    println!("joints {mean:.1} mm off, at most {worst:.1}");
    assert!(
        mean < 4.0 && worst < 10.0,
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

/// A body whose arms hang by the flanks, and which of its vertices are closed in by more than a little. By a search through all pairs.
fn arms_down(model: &BodyModel) -> (State, Vec<bool>) {
    let mut state = posed_body(model);
    for (joint, degrees) in [(Joint::LeftShoulder, -16.0), (Joint::RightShoulder, 46.0)] {
        let turn = f64::to_radians(degrees);
        state.turn(joint, DMat3::from_axis_angle(DVec3::Z, turn));
    }
    let (here, _) = skinned_by_hand(model, &state);
    let (_, rest_joints) = model.shaped(&state.shape);
    let straight = State {
        rotations: t_pose(&rest_joints),
        ..state.clone()
    };
    let (there, _) = skinned_by_hand(model, &straight);
    let outer: Vec<usize> = (0..model.body_vertices)
        .filter(|v| model.outer[*v] && model.finger_share(*v) < 0.1)
        .collect();
    let normals = vertex_normals(&here, &model.faces, DVec3::ZERO);
    let mut closed_in = vec![false; model.body_vertices];
    for v in &outer {
        closed_in[*v] = outer.iter().any(|other| {
            let apart = here[*v].distance(here[*other]);
            let is_before = (here[*other] - here[*v]).dot(normals[*v]) > 0.2 * apart;
            is_before && apart < 0.04 && there[*v].distance(there[*other]) > apart + 0.1
        });
    }
    (state, closed_in)
}

#[test]
fn a_sheet_between_arm_and_flank_is_neither() {
    let Some(model) = model() else { return };
    let (state, closed_in) = arms_down(model);
    let count = closed_in.iter().filter(|closed| **closed).count();
    assert!(count > 200, "{count} vertices are closed in");
    let (truth, _) = skinned_by_hand(model, &state);
    let (points, mut middles, mut outwards, joints) = seen(model, &state);
    let register_it = |points_: &[Vec3], normals: &[Vec3]| {
        let observed = Observed {
            body: &points,
            face: None,
            points: points_,
            normals,
            hints: &[],
        };
        register(model, &observed).expect("a body").0
    };
    let clean = register_it(&middles, &outwards);
    // What depth shows there: nothing of the skin, but a surface 20 mm before it.
    let normals = vertex_normals(&truth, &model.faces, DVec3::ZERO);
    let mut moved = 0;
    for (at, face) in outer_faces(model).enumerate() {
        if face.iter().all(|v| closed_in[*v]) {
            let normal = face.iter().map(|v| normals[*v]).sum::<DVec3>().normalize();
            middles[at] += 0.02 * normal.as_vec3();
            outwards[at] = normal.as_vec3();
            moved += 1;
        }
    }
    assert!(moved > 300, "the sheet has {moved} points");
    let found = register_it(&middles, &outwards);
    let off = |found: &Registered| {
        let mut off: Vec<f64> = (0..model.body_vertices)
            .filter(|v| closed_in[*v])
            .map(|v| 1e3 * (found.vertices[v] - truth[v]).dot(normals[v]).abs())
            .collect();
        off.sort_by(f64::total_cmp);
        (off[off.len() / 2], off[off.len() - 1])
    };
    let apart = (0..22).map(|j| 1e3 * found.joints[j].distance(clean.joints[j]));
    let apart = apart.fold(0.0, f64::max);
    let worst = (0..22).map(|j| 1e3 * found.joints[j].distance(joints[j]));
    let worst = worst.fold(0.0, f64::max);
    println!(
        "{count} closed in: {:.1?} mm off with the sheet, {:.1?} without; joints {apart:.1} mm apart, {worst:.1} off",
        off(&found),
        off(&clean)
    );
    let (median, most) = off(&found);
    assert!(median < 2.0 && most < 8.0, "{median} and {most} mm off");
    assert!(apart < 1.0, "the sheet moves a joint by {apart} mm");
    assert!(worst < 10.0, "a joint is {worst} mm off");
}

#[test]
fn a_wrong_landmark_is_told_and_a_hint_heals_it() {
    let Some(model) = model() else { return };
    let state = posed_body(model);
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
fn a_hint_that_all_else_contradicts_is_doubted_and_one_that_agrees_is_not() {
    let Some(model) = model() else { return };
    let state = posed_body(model);
    let (points, middles, outwards, joints) = seen(model, &state);
    let at = Joint::LeftWrist.index();
    for (mistake, sure) in [(DVec3::ZERO, true), (DVec3::new(0.0, -0.14, 0.1), false)] {
        let observed = Observed {
            body: &points,
            face: None,
            points: &middles,
            normals: &outwards,
            hints: &[Hint {
                joint: Joint::LeftWrist,
                position: joints[at] + mistake,
            }],
        };
        let (found, report) = register(model, &observed).expect("a body");
        let told = report
            .warnings
            .iter()
            .any(|w| w.contains("--joint left_wrist"));
        assert_eq!(told, !sure, "{:?}", report.warnings);
        assert_eq!(
            found.confidence[at] > 0.5,
            sure,
            "sure to {}",
            found.confidence[at]
        );
        let apart = report.hints[0].apart.expect("found without it as well");
        assert!((apart - mistake.length()).abs() < 0.02, "{apart} m apart");
    }
}

#[test]
fn what_is_no_number_or_missing_is_survived_or_refused() {
    let Some(model) = model() else { return };
    let state = posed_body(model);
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
    let hints = [Hint {
        joint: Joint::LeftHip,
        position: points[23].position,
    }];
    let hinted = Observed {
        hints: &hints,
        ..half
    };
    let (_, report) = register(model, &hinted).expect("the user knows the hip");
    assert_eq!(report.hints[0].apart, None, "not found otherwise");
}
