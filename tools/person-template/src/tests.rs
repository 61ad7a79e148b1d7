//! Parts on the real body model, which `MON3TR_MAKEHUMAN` names.

use crate::body::{Body, Canonical, Shape};
use crate::guard::{room, turn_outwards};
use crate::posing::{CORRECTION, Correction, Derivatives, Posed, motion};
use capture::FramePose;
use glam::{DQuat, DVec3, Vec3};
use scan_rig::body::posing;
use spmm3::{Joint, MotionParams, Skeleton};
use std::path::PathBuf;
use std::sync::OnceLock;

/// The body, built once; `None` (said aloud) on a machine without the package.
fn body() -> Option<&'static Body> {
    static BODY: OnceLock<Option<Body>> = OnceLock::new();
    BODY.get_or_init(|| {
        let found = std::env::var_os("MON3TR_MAKEHUMAN").map(PathBuf::from);
        if found.is_none() {
            let ci = std::env::var("CI").as_deref() == Ok("true");
            assert!(!ci, "MON3TR_MAKEHUMAN must name the MakeHuman data in CI");
            eprintln!("skipped: MON3TR_MAKEHUMAN does not name the MakeHuman data");
        }
        found.map(|path| Body::load(&path).expect("the package is whole"))
    })
    .as_ref()
}

fn shape(body: &Body) -> Shape {
    let mut weights = vec![0.0; body.model.shapes.len()];
    (weights[0], weights[2], weights[5]) = (-0.3, 0.4, 0.2);
    Shape {
        weights,
        log_scale: 0.05,
        cloth: 0.008,
    }
}

fn pose() -> FramePose {
    let mut parameters = MotionParams::default();
    parameters.set_axis_angle(Joint::Pelvis, Vec3::new(0.1, 0.9, -0.05));
    parameters.set_axis_angle(Joint::LeftShoulder, Vec3::new(0.2, -0.3, -0.9));
    parameters.set_axis_angle(Joint::LeftElbow, Vec3::new(0.0, -1.1, 0.0));
    parameters.set_axis_angle(Joint::RightHip, Vec3::new(-0.7, 0.1, -0.2));
    FramePose {
        parameters,
        pelvis: Vec3::new(0.3, 0.9, -0.2),
    }
}

/// Where vertices are with corrections and shape moved by `step`.
fn moved(body: &Body, step: &[f64]) -> Vec<DVec3> {
    let mut shape = shape(body);
    for (weight, step) in shape.weights.iter_mut().zip(&step[CORRECTION..]) {
        *weight += step;
    }
    let shapes = shape.weights.len();
    shape.log_scale += step[CORRECTION + shapes];
    shape.cloth += step[CORRECTION + shapes + 1];
    let mut correction = Correction::default();
    correction.step(&step[..CORRECTION]);
    let canonical = Canonical::clothed(body, &shape);
    Posed::new(&canonical.joints, &pose(), &correction).vertices(&body.skin, &canonical.vertices)
}

#[test]
fn the_derivatives_are_those_of_small_steps() {
    let Some(body) = body() else { return };
    let canonical = Canonical::clothed(body, &shape(body));
    let fields = Canonical::fields(body, &shape(body));
    let posed = Posed::new(&canonical.joints, &pose(), &Correction::default());
    let derivatives = Derivatives::new(body, &posed, &fields);
    let unknowns = derivatives.unknowns();
    let mut row = vec![0.0; unknowns];
    let direction = DVec3::new(0.5, -0.7, 0.4);
    let elbow = 3 + 3 * 16 + 1;
    for at in [
        0,
        2,
        3,
        4,
        5,
        elbow,
        CORRECTION,
        CORRECTION + 5,
        unknowns - 2,
        unknowns - 1,
    ] {
        let size = 1e-4;
        let mut step = vec![0.0; unknowns];
        step[at] = size;
        let there = moved(body, &step);
        step[at] = -size;
        let back = moved(body, &step);
        for vertex in [454, 3000, 7000, 9000, 11_000] {
            let tpose = canonical.vertices[vertex];
            derivatives.of_vertex(vertex, tpose, direction, &mut row);
            let expected = (there[vertex] - back[vertex]).dot(direction) / (2.0 * size);
            // Normals, along which clothes are, turn with the shape: that is left out.
            let allowed = if at >= CORRECTION { 4e-3 } else { 1e-5 };
            assert!(
                (row[at] - expected).abs() < allowed,
                "vertex {vertex}, unknown {at}: {} is not {expected}",
                row[at]
            );
        }
    }
}

#[test]
fn the_t_pose_skinned_back_to_rest_is_the_body_model() {
    let Some(body) = body() else { return };
    let mut shape = shape(body);
    (shape.log_scale, shape.cloth) = (0.0, 0.0);
    let canonical = Canonical::bare(body, &shape);
    let (rest, rest_joints) = body.model.shaped(&shape.weights);
    let straight = posing::t_pose(&rest_joints);
    let mut parameters = MotionParams::default();
    for joint in Joint::ALL {
        let parent = joint
            .parent()
            .map_or(glam::DMat3::IDENTITY, |p| straight[p.index()]);
        // World turns from T-pose to rest, relative to the parent's.
        let local = parent * straight[joint.index()].transpose();
        parameters.set_rotation(joint, DQuat::from_mat3(&local).as_quat());
    }
    let pelvis = rest_joints[0].as_vec3();
    let posed = Posed::new(
        &canonical.joints,
        &FramePose { parameters, pelvis },
        &Correction::default(),
    );
    let vertices = posed.vertices(&body.skin, &canonical.vertices);
    let worst = (vertices.iter().zip(&rest))
        .map(|(got, rest)| got.distance(*rest))
        .fold(0.0, f64::max);
    assert!(worst < 2e-5, "{worst} m off");
    // In T-pose the arms are along x.
    let [shoulder, wrist] =
        [Joint::LeftShoulder, Joint::LeftWrist].map(|joint| canonical.joints[joint.index()]);
    assert!(
        (wrist - shoulder).normalize().x > 0.999,
        "{}",
        wrist - shoulder
    );
}

#[test]
fn a_corrected_motion_poses_the_skeleton_as_the_registration_did() {
    let Some(body) = body() else { return };
    let canonical = Canonical::bare(body, &shape(body));
    let mut correction = Correction::default();
    let step: Vec<f64> = (0..CORRECTION).map(|at| 0.01 * (at as f64).sin()).collect();
    correction.step(&step);
    let posed = Posed::new(&canonical.joints, &pose(), &correction);
    let to_floor = DVec3::new(0.01, 0.93, -0.02);
    let skeleton = Skeleton::new(canonical.joints.map(|joint| (joint + to_floor).as_vec3()));
    let motion = motion(&pose(), &correction, to_floor);
    let transforms = skeleton.expect("a skeleton").pose(&motion);
    for joint in Joint::ALL {
        let place = (transforms.position(joint) + motion.root_translation).as_dvec3();
        let off = place.distance(posed.joints[joint.index()]);
        assert!(off < 1e-5, "{joint:?} is {off} m off");
    }
}

#[test]
fn legs_leave_each_other_room_and_what_would_be_inside_out_is_turned_outwards() {
    let Some(body) = body() else { return };
    let bare = Canonical::bare(body, &shape(body));
    let room = room(body, &bare);
    let knee = bare.joints[Joint::LeftKnee.index()];
    // The inside of the left thigh half-way up faces the other leg, its outside nothing.
    let hip = bare.joints[Joint::LeftHip.index()];
    let normals = bare.normals(body);
    let thigh = |way: f64| {
        let middle = 0.5 * (hip + knee);
        (0..body.model.body_vertices)
            .filter(|v| body.free[*v] && normals[*v].x * way > 0.95)
            .min_by(|a, b| {
                let far = |v: &usize| bare.vertices[*v].distance(middle);
                far(a).total_cmp(&far(b))
            })
            .expect("a thigh")
    };
    let (inside, outside) = (thigh(-1.0), thigh(1.0));
    assert!(room[inside] < 0.08, "{} m between the legs", room[inside]);
    assert!(room[outside] > 0.1, "{} m beside the thigh", room[outside]);

    let mut displacement = vec![DVec3::ZERO; body.model.body_vertices];
    let mut random = fastrand::Rng::with_seed(2);
    for v in (0..displacement.len()).step_by(7) {
        let mut any = || random.f64() - 0.5;
        displacement[v] = DVec3::new(any(), any(), any()) * 0.1;
    }
    assert!(
        turn_outwards(body, &bare, &mut displacement) > 0,
        "nothing was wrong"
    );
    assert_eq!(
        turn_outwards(body, &bare, &mut displacement),
        0,
        "some are left"
    );
}

#[test]
fn ears_hands_and_toes_are_found_where_they_are() {
    let Some(body) = body() else { return };
    let canonical = Canonical::bare(body, &shape(body));
    let joint = |joint: Joint| canonical.joints[joint.index()];
    let head = joint(Joint::Head);
    let wholly = |share: &[f64]| -> Vec<usize> {
        let all = share.iter().enumerate();
        all.filter(|(_, share)| **share > 0.99)
            .map(|(v, _)| v)
            .collect()
    };
    let (ears, hands, toes) = (wholly(&body.ear), wholly(&body.hand), wholly(&body.toes));
    assert!(
        ears.len() > 100 && hands.len() > 500 && toes.len() > 200,
        "{}, {} and {} vertices",
        ears.len(),
        hands.len(),
        toes.len()
    );
    for v in ears {
        let from = canonical.vertices[v] - head;
        let beside = (0.05..0.12).contains(&from.x.abs()) && from.z.abs() < 0.08;
        assert!(
            beside && (-0.05..0.15).contains(&from.y),
            "an ear at {from}"
        );
    }
    for v in hands {
        let reach = canonical.vertices[v].x.abs() - joint(Joint::LeftWrist).x;
        assert!(
            (-0.03..0.25).contains(&reach),
            "a hand {reach} m beyond the wrist"
        );
    }
    for v in toes {
        let before = canonical.vertices[v].z - joint(Joint::LeftFoot).z;
        assert!(
            (-0.06..0.15).contains(&before),
            "toes {before} m before the balls"
        );
    }
}
