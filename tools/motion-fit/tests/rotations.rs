//! The fit of rotations and expression weights, as other networks give them.

#![allow(clippy::cast_possible_truncation, reason = "the avatar is f32")]

mod common;
#[path = "common/synthetic.rs"]
mod synthetic;

use common::skeleton;
use glam::{Quat, Vec2, Vec3};
use motion_fit::estimates::{
    BodyEstimate, BodyHints, BodyRotations, FaceEstimate, FaceExpression, HandEstimate,
    HandRotations, JointRotation, Observation,
};
use motion_fit::landmarks::Camera;
use motion_fit::{Fitted, MotionFit, Subject};
use spmm3::{EXPRESSION, ExpressionBasis, ExpressionPreset, Expressions, Joint};
use std::f32::consts::PI;
use synthetic::{Errors, Eye, Network};

fn camera() -> Camera {
    Camera {
        size: Vec2::new(640.0, 480.0),
        focal: 500.0,
        centre: Vec2::new(320.0, 240.0),
    }
}

fn presets() -> Expressions {
    let preset = |slot: usize, jaw| {
        let mut coefficients = [0.0; EXPRESSION];
        coefficients[slot] = 2.0;
        ExpressionPreset { coefficients, jaw }
    };
    [
        ("blink".to_owned(), preset(3, 0.0)),
        ("smile".to_owned(), preset(4, 0.0)),
    ]
    .into()
}

/// What is fitted after `seen` was seen for two seconds.
fn fitted(seen: &Observation) -> Fitted {
    let (skeleton, expressions) = (skeleton(), presets());
    let subject = Subject {
        skeleton: &skeleton,
        expressions: &expressions,
        expression_basis: &ExpressionBasis::MAKEHUMAN_1,
    };
    let mut fit = MotionFit::new(&subject, camera());
    let mut last = fit.step(&Observation::default());
    for k in 1..60 {
        last = fit.step(&Observation {
            seconds: f64::from(k) / 30.0,
            ..seen.clone()
        });
    }
    last
}

fn known(rotation: Quat) -> JointRotation {
    JointRotation {
        rotation,
        confidence: 0.9,
    }
}

/// A person who faces the camera, and whose joints are turned so.
fn body(turned: &[(Joint, Quat)], sight: Option<Vec2>) -> BodyEstimate {
    let mut joints = [known(Quat::IDENTITY); 22];
    joints[0] = known(Quat::from_rotation_x(PI));
    for (joint, rotation) in turned {
        joints[joint.index()] = known(*rotation);
    }
    BodyEstimate::Rotations(Box::new(BodyRotations {
        joints,
        sight,
        landmarks: None,
        hints: BodyHints::default(),
    }))
}

#[track_caller]
fn near(got: Quat, expected: Quat, degrees: f32, what: &str) {
    let apart = got.angle_between(expected).to_degrees();
    assert!(
        apart < degrees,
        "{what}: {got} is {apart} degrees from {expected}"
    );
}

#[test]
fn a_body_of_rotations_takes_the_pose_and_stands_on_the_floor() {
    let knee = Quat::from_rotation_x(0.8);
    let seen = Observation {
        body: Some(body(
            &[
                (Joint::LeftKnee, knee),
                (Joint::RightKnee, knee),
                (Joint::LeftShoulder, Quat::from_rotation_z(-0.9)),
            ],
            None,
        )),
        ..Observation::default()
    };
    let fitted = fitted(&seen);
    assert!(fitted.sees_person, "rotations are a person");
    assert!(fitted.motion.is_finite(), "finite");
    near(fitted.motion.rotation(Joint::LeftKnee), knee, 1.0, "knee");
    let shoulder = fitted.motion.rotation(Joint::LeftShoulder);
    near(shoulder, Quat::from_rotation_z(-0.9), 1.0, "shoulder");
    near(
        fitted.motion.rotation(Joint::Pelvis),
        Quat::IDENTITY,
        1.0,
        "faces the camera",
    );
    assert!(
        fitted.limbs.iter().all(|sure| (sure - 0.9).abs() < 0.01),
        "{:?}",
        fitted.limbs
    );
    // The knees bend backwards: the lowest joint of the feet is where it is in a standing person.
    let skeleton = skeleton();
    let joints = skeleton.pose(&fitted.motion);
    let lowest = [Joint::LeftAnkle, Joint::LeftFoot]
        .map(|joint| joints.position(joint).y + fitted.motion.root_translation.y)
        .into_iter()
        .fold(f32::INFINITY, f32::min);
    let rest = skeleton.rest_positions()[Joint::LeftFoot.index()].y;
    assert!((lowest - rest).abs() < 0.03, "{lowest} against {rest}");
}

#[test]
fn rotations_are_combined_with_the_place_and_the_tilt_that_landmarks_tell() {
    // A camera that looks down by 0.2 rad at a person who faces it; her elbow is bent, which only the rotations say.
    let (skeleton, expressions) = (skeleton(), presets());
    let eye = Eye::new(1.6, 4.0, 0.2);
    let camera = eye.camera;
    let camera_from_room = {
        let [x, y, z] = eye.axes().map(|row| row.map(|v| v as f32));
        glam::Mat3::from_cols_array_2d(&[x, y, z]).transpose()
    };
    let mut network = Network::new(eye, Errors::NONE, 1);
    let truth = spmm3::at_ease(&skeleton);
    let mut joints = [JointRotation::UNKNOWN; 22];
    joints[0] = known(Quat::from_mat3(&camera_from_room));
    let bent = Quat::from_rotation_y(-1.2);
    joints[Joint::LeftElbow.index()] = known(bent);
    let subject = Subject {
        skeleton: &skeleton,
        expressions: &expressions,
        expression_basis: &ExpressionBasis::MAKEHUMAN_1,
    };
    let mut fits = [0, 1].map(|_| MotionFit::new(&subject, camera));
    let mut last = None;
    for k in 0..150 {
        let landmarks = network.look(&skeleton, &truth, 1.0 / 30.0);
        let turned = BodyEstimate::Rotations(Box::new(BodyRotations {
            joints,
            sight: None,
            landmarks: Some(landmarks.clone()),
            hints: BodyHints::default(),
        }));
        let mut seen = [turned, landmarks.into()]
            .map(|body| Observation {
                seconds: f64::from(k) / 30.0,
                body: Some(body),
                ..Observation::default()
            })
            .into_iter();
        last = Some(fits.each_mut().map(|fit| fit.step(&seen.next().unwrap())));
    }
    let [turned, plain] = last.unwrap();
    let elbow = |fitted: &Fitted| fitted.motion.rotation(Joint::LeftElbow);
    near(elbow(&turned), bent, 1.0, "the elbow is the rotations'");
    assert!(
        elbow(&plain).angle_between(bent) > 0.5,
        "landmarks say otherwise"
    );
    let knee = |fitted: &Fitted| fitted.motion.rotation(Joint::LeftKnee);
    near(
        knee(&turned),
        knee(&plain),
        2.0,
        "the knee is the landmarks'",
    );
    let away = turned.motion.root_translation - plain.motion.root_translation;
    assert!(away.length() < 0.02, "the place is the landmarks': {away}");
    // As far as the tilt is known, she is upright.
    let tilt = turned.camera_from_room.matrix3.y_axis.z.abs().asin();
    let up = turned.motion.rotation(Joint::Pelvis) * Vec3::Y;
    let lean = up.z.atan2(up.y).abs();
    assert!(
        (lean - (0.2 - tilt).abs()).abs() < 0.02,
        "tilt {tilt}, lean {lean}"
    );
    println!("tilt {tilt:.3} of 0.2 rad, lean {lean:.3} rad");
}

#[test]
fn what_is_seen_aside_is_turned_by_its_line_of_sight() {
    // A network that knows only its crop sees a person at the picture's right edge from the front: it looks along that line.
    let at = Vec2::new(620.0, 240.0);
    let seen = Observation {
        body: Some(body(&[], Some(at))),
        ..Observation::default()
    };
    let fitted = fitted(&seen);
    let forward = fitted.motion.rotation(Joint::Pelvis) * Vec3::Z;
    // In the room x is to the picture's right, and the camera is at z > 0.
    let expected = -(300.0_f32 / 500.0).atan();
    let yaw = forward.x.atan2(forward.z);
    assert!((yaw - expected).abs() < 0.02, "{yaw} against {expected}");
}

#[test]
fn fingers_and_wrist_of_rotations_are_those_of_the_avatar() {
    let skeleton = skeleton();
    let bend = Quat::from_rotation_z(-0.7);
    let mut joints = [JointRotation::UNKNOWN; 16];
    // The palm as the T-pose has it, of a person who faces the camera, and 0.3 rad further.
    let wrist = Quat::from_rotation_z(0.3);
    joints[0] = known(Quat::from_rotation_x(PI) * wrist);
    joints[1] = known(bend);
    let hand = HandEstimate::Rotations(Box::new(HandRotations {
        joints,
        sight: None,
        landmarks: None,
    }));
    let seen = Observation {
        body: Some(body(&[], None)),
        hands: [Some(hand), None],
        ..Observation::default()
    };
    let fitted = fitted(&seen);
    near(
        fitted.motion.rotation(Joint::LeftIndex1),
        bend,
        1.0,
        "index",
    );
    let ease = spmm3::at_ease(&skeleton);
    near(
        fitted.motion.rotation(Joint::LeftRing2),
        ease.rotation(Joint::LeftRing2),
        1.0,
        "a finger that is unknown is at ease",
    );
    near(
        fitted.motion.rotation(Joint::LeftWrist),
        wrist,
        2.0,
        "wrist",
    );
    assert!(
        (fitted.hands[0] - 0.9).abs() < 0.01 && fitted.hands[1] < 0.01,
        "{:?}",
        fitted.hands
    );
}

fn face(basis: Option<ExpressionBasis>, weights: &[f32]) -> FaceExpression {
    FaceExpression {
        basis,
        weights: weights.to_vec(),
        jaw: JointRotation::UNKNOWN,
        eyes: [JointRotation::UNKNOWN; 2],
        head: JointRotation::UNKNOWN,
        eyelids: None,
        confidence: 0.9,
        sight: None,
        landmarks: None,
    }
}

fn with_face(face: FaceExpression) -> Fitted {
    fitted(&Observation {
        body: Some(body(&[], None)),
        face: Some(FaceEstimate::Expression(Box::new(face))),
        ..Observation::default()
    })
}

#[test]
fn weights_of_the_avatars_basis_are_shown_and_arkits_become_presets() {
    let own = with_face(face(Some(ExpressionBasis::MAKEHUMAN_1), &[0.5, -1.0, 0.25]));
    let shown = own.motion.expression();
    for (got, expected) in shown.iter().zip([0.5, -1.0, 0.25, 0.0]) {
        assert!((got - expected).abs() < 0.01, "{shown:?}");
    }
    let mut shapes = [0.0; 52];
    // mouthSmileLeft, mouthSmileRight, jawOpen.
    for slot in [43, 44, 24] {
        shapes[slot] = 1.0;
    }
    let arkit = with_face(face(Some(ExpressionBasis::ARKIT_52), &shapes));
    let shown = arkit.motion.expression();
    assert!((shown[4] - 2.0).abs() < 0.02, "a smile: {shown:?}");
    assert!(arkit.motion.axis_angle(Joint::Jaw).x > 0.3, "the jaw opens");
}

#[test]
fn weights_of_another_basis_leave_the_face_at_rest_but_jaw_lids_eyes_and_head_move() {
    let turn = Quat::from_rotation_y(0.4);
    let fitted = with_face(FaceExpression {
        jaw: known(Quat::from_rotation_x(0.2)),
        eyes: [known(Quat::from_rotation_y(0.2)); 2],
        head: known(Quat::from_rotation_x(PI) * turn),
        eyelids: Some([0.9, 0.85]),
        ..face(Some(ExpressionBasis::FLAME_2020), &[1.0; 50])
    });
    let shown = fitted.motion.expression();
    assert!(
        (shown[3] - 1.7).abs() < 0.02,
        "the more open eye's lid: {shown:?}"
    );
    assert!(
        shown
            .iter()
            .enumerate()
            .all(|(slot, v)| slot == 3 || v.abs() < 1e-4),
        "{shown:?}"
    );
    near(
        fitted.motion.rotation(Joint::Jaw),
        Quat::from_rotation_x(0.2),
        0.5,
        "jaw",
    );
    near(
        fitted.motion.rotation(Joint::LeftEye),
        Quat::from_rotation_y(0.2),
        0.5,
        "eye",
    );
    let neck = fitted.motion.rotation(Joint::Neck) * fitted.motion.rotation(Joint::Head);
    near(neck, turn, 1.0, "head");
}

#[test]
fn numbers_that_are_none_are_not_seen() {
    for bad in [f32::NAN, f32::INFINITY] {
        let fitted = with_face(FaceExpression {
            jaw: known(Quat::from_xyzw(bad, 0.0, 0.0, 1.0)),
            head: known(Quat::from_xyzw(0.0, bad, 0.0, 1.0)),
            eyelids: Some([bad; 2]),
            sight: Some(Vec2::splat(bad)),
            ..face(Some(ExpressionBasis::MAKEHUMAN_1), &[bad, 1.0])
        });
        assert!(fitted.motion.is_finite(), "{bad}");
        assert!(
            fitted.motion.expression().iter().all(|v| v.abs() < 1e-4),
            "{bad}: at rest"
        );
        let all = Observation {
            body: Some(body(
                &[
                    (Joint::Pelvis, Quat::from_xyzw(bad, bad, bad, bad)),
                    (Joint::LeftHip, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
                    (Joint::Head, Quat::from_xyzw(0.0, 0.0, bad, 0.0)),
                ],
                Some(Vec2::new(bad, 1.0)),
            )),
            hands: [0, 1].map(|_| {
                Some(HandEstimate::Rotations(Box::new(HandRotations {
                    joints: [known(Quat::from_xyzw(bad, 0.0, 0.0, 1.0)); 16],
                    sight: Some(Vec2::new(1.0, bad)),
                    landmarks: None,
                })))
            }),
            ..Observation::default()
        };
        let fitted = self::fitted(&all);
        assert!(fitted.motion.is_finite(), "{bad}");
        assert!(fitted.camera_from_room.is_finite(), "{bad}");
        near(
            fitted.motion.rotation(Joint::LeftHip),
            Quat::IDENTITY,
            30.0,
            "at rest",
        );
    }
}
