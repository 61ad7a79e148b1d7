//! The tracked face and gaze.

use glam::{Affine3A, Quat, Vec3};
use motion_fit::wearer::{ARKIT_OF_HEADSET, FACE_EXPRESSION_NAMES, WearerExpression};
use motion_fit::wearer::{WearerFace, WearerGaze, WearerSample};
use openxr::sys::FaceExpression2FB as Named;
use spmm3::{EXPRESSION, ExpressionBasis, ExpressionPreset, Expressions, Joint, MotionParams};

/// A face that makes these expressions.
fn face(weights: &[(Named, f32)]) -> WearerSample {
    let mut face = WearerFace {
        weights: [0.0; 70],
        confidence: 0.8,
        eyes_look: false,
    };
    for (expression, weight) in weights {
        face.weights[expression.into_raw() as usize] = *weight;
    }
    WearerSample {
        face: Some(face),
        ..WearerSample::default()
    }
}

/// What an avatar of that basis with those named expressions shows of it.
fn shown(
    sample: &WearerSample,
    basis: &ExpressionBasis,
    presets: &Expressions,
) -> (MotionParams, Option<f32>) {
    let mut motion = MotionParams::default();
    let confidence = WearerExpression::new(basis, presets).show(sample, &mut motion);
    (motion, confidence)
}

/// An avatar whose every named expression has a slot of its own.
fn presets() -> Expressions {
    let names = ["blink", "smile", "brows_up", "brows_down", "o", "u", "mbp"];
    let preset = |slot: usize| {
        let mut coefficients = [0.0; EXPRESSION];
        coefficients[slot] = 2.0;
        ExpressionPreset {
            coefficients,
            jaw: 0.0,
        }
    };
    let named = names.iter().enumerate();
    named
        .map(|(slot, name)| ((*name).to_owned(), preset(slot)))
        .collect()
}

#[test]
fn expressions_have_the_names_and_the_order_of_the_registry() {
    for (number, name) in FACE_EXPRESSION_NAMES.iter().enumerate() {
        let known = format!("{:?}", Named::from_raw(number as i32));
        assert_eq!(*name, known, "expression {number}");
    }
}

#[test]
fn every_shape_of_arkits_is_made_of_expressions_that_there_are() {
    let mut shapes: Vec<_> = ARKIT_OF_HEADSET.iter().map(|(name, _)| *name).collect();
    for (shape, from) in ARKIT_OF_HEADSET {
        assert!(!from.is_empty(), "{shape}");
        for name in from {
            assert!(FACE_EXPRESSION_NAMES.contains(name), "{shape} of {name}");
        }
    }
    // The order is the alphabet's, as ARKIT_52's documentation says.
    let ordered = shapes.clone();
    shapes.sort_unstable();
    shapes.dedup();
    assert_eq!(shapes, ordered, "in order, each once");
}

#[test]
fn jaw_smile_and_each_blink_come_out_in_arkits_own_slots() {
    for (expression, slot, name) in [
        (Named::JAW_DROP, 24, "jawOpen"),
        (Named::LIP_CORNER_PULLER_L, 43, "mouthSmileLeft"),
        (Named::LIP_CORNER_PULLER_R, 44, "mouthSmileRight"),
        (Named::EYES_CLOSED_L, 8, "eyeBlinkLeft"),
        (Named::EYES_CLOSED_R, 9, "eyeBlinkRight"),
    ] {
        let sample = face(&[(expression, 0.6)]);
        let (motion, confidence) = shown(&sample, &ExpressionBasis::ARKIT_52, &presets());
        let mut expected = [0.0; EXPRESSION];
        expected[slot] = 0.6;
        assert_eq!(motion.expression(), expected, "{name}");
        assert_eq!(confidence, Some(0.8), "{name}");
    }
}

#[test]
fn jaw_smile_and_each_blink_are_the_avatars_own() {
    let basis = ExpressionBasis::MAKEHUMAN_1;
    let slots = |weights: &[(Named, f32)]| {
        let (motion, _) = shown(&face(weights), &basis, &presets());
        let set = motion.expression().iter().enumerate();
        let set: Vec<_> = set
            .filter(|(_, v)| **v != 0.0)
            .map(|(k, v)| (k, *v))
            .collect();
        (set, motion.axis_angle(Joint::Jaw).x)
    };
    let (set, jaw) = slots(&[(Named::JAW_DROP, 1.0)]);
    assert_eq!(set, [], "the jaw is a joint");
    assert!((0.3..0.45).contains(&jaw), "wide open: {jaw}");
    let smile = [
        (Named::LIP_CORNER_PULLER_L, 1.0),
        (Named::LIP_CORNER_PULLER_R, 1.0),
    ];
    assert_eq!(slots(&smile), (vec![(1, 2.0)], 0.0), "a smile");
    assert_eq!(slots(&smile[..1]), (vec![(1, 1.0)], 0.0), "half of one");
    let blink = [(Named::EYES_CLOSED_L, 1.0), (Named::EYES_CLOSED_R, 1.0)];
    assert_eq!(slots(&blink), (vec![(0, 2.0)], 0.0), "a blink");
    assert_eq!(slots(&blink[1..]), (vec![(0, 1.0)], 0.0), "half of one");
    let pucker = [(Named::LIP_PUCKER_L, 1.0), (Named::LIP_PUCKER_R, 1.0)];
    assert_eq!(slots(&pucker), (vec![(5, 2.0)], 0.0), "pursed lips");
}

#[test]
fn a_face_that_is_not_tracked_or_no_number_moves_nothing() {
    let basis = ExpressionBasis::MAKEHUMAN_1;
    let (motion, confidence) = shown(&WearerSample::default(), &basis, &presets());
    assert_eq!(
        (motion, confidence),
        (MotionParams::default(), None),
        "none"
    );
    let mut sample = face(&[
        (Named::JAW_DROP, f32::NAN),
        (Named::EYES_CLOSED_L, f32::INFINITY),
    ]);
    if let Some(face) = &mut sample.face {
        face.confidence = f32::NAN;
    }
    let (motion, confidence) = shown(&sample, &basis, &presets());
    assert_eq!(
        (motion, confidence),
        (MotionParams::default(), Some(0.0)),
        "no numbers"
    );
}

/// A head that is turned and elsewhere, and its eyes' gaze: to the person's left and up, radians.
fn gazing(left: f32, up: f32, confidence: f32) -> WearerSample {
    let floor_from_view = Affine3A::from_rotation_translation(
        Quat::from_rotation_y(1.1) * Quat::from_rotation_x(-0.3),
        Vec3::new(0.4, 1.7, -2.0),
    );
    // In a view -z is ahead, and -x the person's left: turned to it is a positive turn about y.
    let view_from_eye = Quat::from_rotation_y(left) * Quat::from_rotation_x(up);
    let gaze = WearerGaze {
        floor_from_eye: floor_from_view * Affine3A::from_quat(view_from_eye),
        confidence,
    };
    WearerSample {
        floor_from_view: Some(floor_from_view),
        gazes: [Some(gaze); 2],
        ..WearerSample::default()
    }
}

#[test]
fn eyes_look_where_the_wearers_do() {
    let basis = ExpressionBasis::MAKEHUMAN_1;
    for (left, up) in [(0.3, 0.0), (-0.4, 0.2), (0.0, -0.35)] {
        let (motion, face) = shown(&gazing(left, up, 0.9), &basis, &presets());
        assert_eq!(face, None, "a gaze is no face");
        for eye in [Joint::LeftEye, Joint::RightEye] {
            // The avatar faces +z, its left at +x: where its eye looks.
            let turn = motion.axis_angle(eye);
            let ahead = Quat::from_scaled_axis(turn) * Vec3::Z;
            let expected = Vec3::new(left.sin() * up.cos(), up.sin(), left.cos() * up.cos());
            assert!(ahead.distance(expected) < 1e-4, "{left}, {up}: {ahead}");
        }
    }
    let (motion, _) = shown(&gazing(0.3, 0.0, 0.1), &basis, &presets());
    assert_eq!(motion, MotionParams::default(), "not sure");
    let (motion, _) = shown(&gazing(1.5, 1.2, 1.0), &basis, &presets());
    let ahead = Quat::from_scaled_axis(motion.axis_angle(Joint::LeftEye)) * Vec3::Z;
    assert!(ahead.z > 0.6, "no eye turns out of sight: {ahead}");
}

#[test]
fn the_faces_looks_count_where_no_gaze_is_tracked() {
    let basis = ExpressionBasis::MAKEHUMAN_1;
    let looks = [
        (Named::EYES_LOOK_LEFT_L, 1.0),
        (Named::EYES_LOOK_LEFT_R, 1.0),
    ];
    let mut sample = face(&looks);
    let (motion, _) = shown(&sample, &basis, &presets());
    assert_eq!(motion.axis_angle(Joint::LeftEye), Vec3::ZERO, "not valid");
    sample.face.as_mut().expect("a face").eyes_look = true;
    let (motion, _) = shown(&sample, &basis, &presets());
    for eye in [Joint::LeftEye, Joint::RightEye] {
        let ahead = Quat::from_scaled_axis(motion.axis_angle(eye)) * Vec3::Z;
        assert!(ahead.x > 0.4, "to the left: {ahead}");
    }
    let gazing = gazing(-0.3, 0.0, 0.9);
    sample.floor_from_view = gazing.floor_from_view;
    sample.gazes = gazing.gazes;
    let (motion, _) = shown(&sample, &basis, &presets());
    let ahead = Quat::from_scaled_axis(motion.axis_angle(Joint::LeftEye)) * Vec3::Z;
    assert!(ahead.x < -0.2, "the gaze is what was measured: {ahead}");
}
