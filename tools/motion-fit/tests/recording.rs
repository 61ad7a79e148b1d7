//! A whole recording against the same pictures one after the other.

#![allow(
    clippy::cast_possible_truncation,
    reason = "the avatar is f32, and counts of frames are small"
)]

mod common;
#[path = "common/synthetic.rs"]
mod synthetic;

use common::skeleton;
use glam::Vec3;
use motion_fit::landmarks::Observation;
use motion_fit::{Fitted, MotionFit, Subject, fit_recording};
use spmm3::{ExpressionBasis, Expressions, Joint, MotionParams};
use synthetic::{Errors, Eye, Network, RATE, Score, score};

/// A person who shifts their weight, bends a little and swings their arms; both feet stand.
fn sway(frame: usize) -> MotionParams {
    let swing = (frame as f32 / RATE as f32 * 3.0).sin();
    let bend = 0.25 + 0.15 * swing;
    let mut motion = MotionParams::default();
    for (joint, turn) in [
        (Joint::LeftHip, [-bend, 0.0, 0.0]),
        (Joint::RightHip, [-bend, 0.0, 0.0]),
        (Joint::LeftKnee, [2.0 * bend, 0.0, 0.0]),
        (Joint::RightKnee, [2.0 * bend, 0.0, 0.0]),
        (Joint::LeftAnkle, [-bend, 0.0, 0.0]),
        (Joint::RightAnkle, [-bend, 0.0, 0.0]),
        (Joint::LeftShoulder, [0.0, 0.5 * swing, -1.0]),
        (Joint::RightShoulder, [0.0, 0.5 * swing, 1.0]),
        (Joint::LeftElbow, [0.0, -0.8, 0.0]),
    ] {
        motion.set_axis_angle(joint, Vec3::from_array(turn));
    }
    // The ankles stay where they are.
    let ankle = skeleton().pose(&motion).position(Joint::LeftAnkle);
    let rest = skeleton().rest_positions()[Joint::LeftAnkle.index()];
    motion.root_translation = Vec3::new(0.0, rest.y - ankle.y, rest.z - ankle.z);
    motion
}

fn seen(truth: &[MotionParams], eye: Eye, seed: u64) -> Vec<Observation> {
    let mut network = Network::new(eye, Errors::USUAL, seed);
    (truth.iter().enumerate())
        .map(|(frame, motion)| Observation {
            seconds: frame as f64 / RATE,
            body: Some(network.look(&skeleton(), motion, 1.0 / RATE).into()),
            ..Observation::default()
        })
        .collect()
}

#[test]
fn a_whole_recording_is_nearer_to_the_truth_and_slides_less_than_its_pictures_one_by_one() {
    let (skeleton, expressions) = (skeleton(), Expressions::default());
    let subject = Subject {
        skeleton: &skeleton,
        expressions: &expressions,
        expression_basis: &ExpressionBasis::MAKEHUMAN_1,
    };
    let truth: Vec<_> = (0..150).map(sway).collect();
    let eye = Eye::new(1.4, 3.4, 0.12);
    let mut sums = [Score::default(); 2];
    for seed in 1..4 {
        let seen = seen(&truth, eye, seed);
        let mut fit = MotionFit::new(&subject, eye.camera);
        let live: Vec<Fitted> = seen.iter().map(|seen| fit.step(seen)).collect();
        let whole = fit_recording(&subject, eye.camera, &seen);
        assert_eq!(whole.len(), seen.len(), "a frame for each picture");
        for (sum, fitted) in sums.iter_mut().zip([live, whole]) {
            let motions: Vec<_> = fitted.into_iter().map(|fitted| fitted.motion).collect();
            let score = score(&skeleton, &truth, &motions, RATE, 10);
            sum.limbs_mm += score.limbs_mm / 3.0;
            sum.slide[0] += score.slide[0] / 3.0;
            sum.jitter[0] += score.jitter[0] / 3.0;
        }
    }
    let [live, whole] = sums;
    for (name, live, whole, share) in [
        ("limbs, mm", live.limbs_mm, whole.limbs_mm, 1.0),
        ("slide, m/s", live.slide[0], whole.slide[0], 0.8),
        ("jitter, mm", live.jitter[0], whole.jitter[0], 1.0),
    ] {
        println!("{name}: live {live:.3}, as a recording {whole:.3}");
        assert!(whole < share * live, "{name}: {whole} against {live}");
    }
}

#[test]
fn recordings_without_pictures_or_people_are_fitted_too() {
    let (skeleton, expressions) = (skeleton(), Expressions::default());
    let subject = Subject {
        skeleton: &skeleton,
        expressions: &expressions,
        expression_basis: &ExpressionBasis::MAKEHUMAN_1,
    };
    let camera = Eye::new(1.4, 3.4, 0.12).camera;
    assert!(
        fit_recording(&subject, camera, &[]).is_empty(),
        "no pictures"
    );
    let empty: Vec<_> = [0.0, f64::NAN, -1.0, 5.0, 5.0]
        .map(|seconds| Observation {
            seconds,
            ..Observation::default()
        })
        .to_vec();
    let fitted = fit_recording(&subject, camera, &empty);
    assert_eq!(fitted.len(), empty.len(), "one for each picture");
    assert!(
        (fitted.iter()).all(|fitted| !fitted.sees_person && fitted.motion.is_finite()),
        "nobody"
    );
}
