//! A calibration against scenes whose camera is known: an independent kinematics in f64, projected by a pinhole of its own.

#![allow(
    clippy::cast_possible_truncation,
    reason = "the landmarks and the avatar are f32, and counts of frames are small"
)]

mod common;
#[path = "common/synthetic.rs"]
mod synthetic;

use glam::{Quat, Vec2, Vec3};
use motion_fit::body::{BodyFit, FitConfig};
use motion_fit::calibration::{Calibration, Calibrator, Missing, Progress};
use motion_fit::landmarks::{BodyLandmarks, Camera, Observation};
use motion_fit::{MotionFit, Subject};
use spmm3::{ExpressionBasis, Expressions, Joint, MotionParams};
use synthetic::{Errors, Eye, Network, RATE};

/// A person at ease, facing the camera.
fn at_ease() -> MotionParams {
    spmm3::at_ease(&common::skeleton())
}

/// An eye of `view` degrees along the picture's longer side.
fn eye(height: f64, distance: f64, pitch: f64, view: f32) -> Eye {
    Eye {
        camera: Camera::of_view(Vec2::new(720.0, 960.0), view),
        ..Eye::new(height, distance, pitch)
    }
}

/// What the network sees of `motion` for `seconds`.
fn seen(
    eye: Eye,
    errors: Errors,
    seed: u64,
    seconds: f64,
    motion: &MotionParams,
) -> Vec<BodyLandmarks> {
    let skeleton = common::skeleton();
    let mut network = Network::new(eye, errors, seed);
    (0..(seconds * RATE) as usize)
        .map(|_| network.look(&skeleton, motion, 1.0 / RATE))
        .collect()
}

/// What became of the calibration, with the number of pictures that it took.
fn calibrated(camera: Camera, seen: &[BodyLandmarks]) -> (Option<Calibration>, usize) {
    let mut calibrator = Calibrator::new(&common::skeleton(), camera);
    for (k, body) in seen.iter().enumerate() {
        if let Progress::Done(calibration) = calibrator.see(k as f64 / RATE, Some(body)) {
            return (Some(calibration), k);
        }
    }
    (None, seen.len())
}

#[test]
fn pitch_and_height_of_a_known_camera_are_found_in_two_seconds_at_any_known_view() {
    for (height, distance, pitch, view) in [
        (1.0, 3.0, 0.0, 50.0),
        (1.6, 3.0, 0.25, 65.0),
        (0.4, 2.6, -0.25, 80.0),
        (2.2, 3.5, 0.4, 65.0),
        (1.2, 2.5, 0.1, 90.0),
    ] {
        let eye = eye(height, distance, pitch, view);
        let seen = seen(eye, Errors::NONE, 1, 3.0, &at_ease());
        let (found, pictures) = calibrated(eye.camera, &seen);
        let found = found.expect("the person stands");
        assert!(
            pictures.abs_diff(60) <= 1,
            "two seconds: {pictures} pictures"
        );
        println!(
            "pitch {:.3} of {pitch}, height {:.3} of {height}",
            found.pitch_radians(),
            found.height_metres
        );
        // Landmarks of shoulders and ankles are not above one another: a degree or two.
        assert!(
            (found.pitch_radians() - pitch).abs() < 0.04,
            "pitch {found:?}"
        );
        assert!(found.roll_radians().abs() < 0.01, "roll {found:?}");
        assert!(
            (found.height_metres - height).abs() < 0.12,
            "height {found:?}"
        );
    }
}

#[test]
fn with_the_errors_of_a_network_it_is_right_within_degrees_and_a_hand() {
    let skeleton = common::skeleton();
    let (height, pitch, seeds) = (1.5, 0.35, 11..27);
    let count = seeds.clone().count() as f64;
    // Squares of errors: of the calibration, and of the fit that learns while it looks as long.
    let (mut calibration, mut learnt) = ([0.0; 2], [0.0; 2]);
    for seed in seeds {
        let eye = eye(height, 3.0, pitch, 65.0);
        let seen = seen(eye, Errors::USUAL, seed, 4.0, &at_ease());
        let (found, pictures) = calibrated(eye.camera, &seen);
        let found = found.unwrap_or_else(|| panic!("seed {seed}: not in {pictures} pictures"));
        let mut fit = BodyFit::new(&skeleton, FitConfig::new(eye.camera));
        let poses = seen.iter().take(pictures + 1).enumerate();
        let last = poses.map(|(k, body)| fit.fit(k as f64 / RATE, Some(body)));
        let camera = last.last().expect("pictures").camera;
        for (squares, [found_pitch, found_height]) in [
            (
                &mut calibration,
                [found.pitch_radians(), found.height_metres],
            ),
            (
                &mut learnt,
                [camera.pitch_radians, camera.height_metres].map(f64::from),
            ),
        ] {
            squares[0] += (found_pitch - pitch).powi(2) / count;
            squares[1] += (found_height - height).powi(2) / count;
        }
    }
    let [pitch_error, height_error] = calibration.map(f64::sqrt);
    let [pitch_learnt, height_learnt] = learnt.map(f64::sqrt);
    println!(
        "root mean square of 16: pitch {pitch_error:.3} rad, height {height_error:.2} m; learnt meanwhile without: {pitch_learnt:.3} rad, {height_learnt:.2} m"
    );
    assert!(
        pitch_error < 0.12 && height_error < 0.3,
        "{pitch_error} rad, {height_error} m"
    );
}

#[test]
fn a_standing_person_does_not_tell_the_field_of_view() {
    let sees = |view: f32, distance: f64| {
        let eye = eye(1.0, distance, 0.0, view);
        seen(eye, Errors::NONE, 1, 0.1, &at_ease()).remove(0)
    };
    let usual = sees(50.0, 3.0);
    // As large in the picture through another lens, from elsewhere.
    let ratio = (25.0_f64.to_radians()).tan() / (32.5_f64.to_radians()).tan();
    let other = sees(65.0, 3.0 * ratio);
    let furthest = (usual.points.iter().zip(&other.points))
        .filter(|(a, _)| a.pixel != Vec2::ZERO)
        .map(|(a, b)| a.pixel.distance(b.pixel))
        .fold(0.0, f32::max);
    // The errors of networks are as large: 1 % of a person's height.
    println!("{furthest:.1} pixels apart");
    assert!(furthest < 12.0, "{furthest} pixels apart");
}

#[test]
fn only_a_whole_person_who_stands_still_and_straight_calibrates() {
    let eye = eye(1.2, 3.0, 0.1, 65.0);
    let skeleton = common::skeleton();
    let state_of = |bodies: &[BodyLandmarks]| {
        let mut calibrator = Calibrator::new(&skeleton, eye.camera);
        let states = bodies.iter().enumerate();
        let states = states.map(|(k, body)| calibrator.see(k as f64 / RATE, Some(body)));
        states.last().expect("pictures")
    };
    let mut squatting = at_ease();
    for (joint, turn) in [
        (Joint::LeftHip, -1.2),
        (Joint::RightHip, -1.2),
        (Joint::LeftKnee, 1.4),
        (Joint::RightKnee, 1.4),
    ] {
        squatting.set_rotation(joint, Quat::from_rotation_x(turn));
    }
    let squat = seen(eye, Errors::NONE, 1, 3.0, &squatting);
    assert_eq!(state_of(&squat), Progress::Waiting(Missing::Standing));
    let mut desk = seen(eye, Errors::NONE, 1, 3.0, &at_ease());
    for point in desk.iter_mut().flat_map(|body| &mut body.points[25..]) {
        point.confidence = 0.05;
    }
    assert_eq!(state_of(&desk), Progress::Waiting(Missing::WholeBody));
    // Walking across the picture at 1 m/s.
    let mut network = Network::new(eye, Errors::NONE, 1);
    let mut walking = at_ease();
    let across: Vec<_> = (0..90)
        .map(|k| {
            walking.root_translation.x = -1.0 + k as f32 / 30.0;
            network.look(&skeleton, &walking, 1.0 / RATE)
        })
        .collect();
    let mut calibrator = Calibrator::new(&skeleton, eye.camera);
    for (k, body) in across.iter().enumerate() {
        let state = calibrator.see(k as f64 / RATE, Some(body));
        assert!(!matches!(state, Progress::Done(_)), "done in picture {k}");
    }
    // What is no number is not seen, and nothing is seen of no body.
    let mut mad = seen(eye, Errors::NONE, 1, 3.0, &at_ease());
    for body in &mut mad {
        body.points[11].metres = Vec3::NAN;
    }
    assert_eq!(state_of(&mad), Progress::Waiting(Missing::WholeBody));
    let mut calibrator = Calibrator::new(&skeleton, eye.camera);
    assert_eq!(
        calibrator.see(0.0, None),
        Progress::Waiting(Missing::WholeBody)
    );
    assert_eq!(
        calibrator.see(f64::NAN, Some(&across[0])),
        Progress::Waiting(Missing::WholeBody)
    );
}

#[test]
fn what_was_calibrated_is_held_whatever_the_person_does_then() {
    let skeleton = common::skeleton();
    let (expressions, basis) = (Expressions::default(), ExpressionBasis::MAKEHUMAN_1);
    let subject = Subject {
        skeleton: &skeleton,
        expressions: &expressions,
        expression_basis: &basis,
    };
    let eye = eye(1.4, 3.0, 0.2, 65.0);
    let mut network = Network::new(eye, Errors::USUAL, 3);
    let mut fit = MotionFit::new(&subject, eye.camera);
    let mut calibrator = Calibrator::new(&skeleton, eye.camera);
    fit.begin_calibration();
    let mut held = None;
    // Stands for three seconds, then leans far forward for ten.
    let mut leaning = at_ease();
    leaning.set_rotation(Joint::Pelvis, Quat::from_rotation_x(0.5));
    for k in 0..390 {
        let seconds = f64::from(k) / RATE;
        let motion = if k < 90 { at_ease() } else { leaning.clone() };
        let body = network.look(&skeleton, &motion, 1.0 / RATE);
        if held.is_none()
            && let Progress::Done(calibration) = calibrator.see(seconds, Some(&body))
        {
            fit.hold(&calibration);
            held = Some(calibration);
        }
        let fitted = fit.step(&Observation {
            seconds,
            body: Some(body.into()),
            ..Observation::default()
        });
        if let Some(calibration) = &held {
            let up = fitted.camera_from_room.matrix3.y_axis;
            // Camera axes have y down and z away.
            let off = [
                f64::from(up.x) - calibration.up.x,
                f64::from(-up.y) - calibration.up.y,
                f64::from(-up.z) - calibration.up.z,
            ];
            assert!(off.iter().all(|v| v.abs() < 1e-5), "picture {k}: {off:?}");
            let eye = fitted.camera_from_room.inverse().translation;
            let height = f64::from(eye.y) - calibration.height_metres;
            assert!(height.abs() < 1e-4, "picture {k}: {height} m");
        }
    }
    assert!(held.is_some(), "calibrated");
}
