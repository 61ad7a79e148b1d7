//! Lag and jitter of smoothing.

#![allow(
    clippy::cast_possible_truncation,
    reason = "the landmarks and the avatar are f32, and counts of frames are small"
)]

mod common;

use common::Random;
use glam::Vec3;
use motion_fit::smoother::{Confidence, SmoothConfig, Smoother, smooth_all};
use spmm3::{Joint, MotionParams};

/// A swing of half a radian whose frequency rises from 0.2 to 3 Hz within 20 s: angle at a time.
fn chirp(seconds: f64) -> f64 {
    let phase = std::f64::consts::TAU * (0.2 * seconds + 0.5 * (2.8 / 20.0) * seconds * seconds);
    0.5 * phase.sin()
}

/// The time by which `late` follows [`chirp`] at best, ms.
fn lag_ms(late: &[f64], rate: f64) -> f64 {
    let error = |lag: f64| -> f64 {
        late.iter()
            .enumerate()
            .skip(10)
            .map(|(i, v)| (v - chirp(i as f64 / rate - lag)).powi(2))
            .sum()
    };
    (0..200)
        .map(|ms| (ms, error(f64::from(ms) / 1e3)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(f64::NAN, |(ms, _)| f64::from(ms))
}

#[test]
fn what_moves_lags_by_less_than_forty_milliseconds() {
    for rate in [30.0, 60.0] {
        let joints = [Joint::LeftElbow, Joint::Head, Joint::LeftIndex1, Joint::Jaw];
        let mut smoother = Smoother::new(SmoothConfig::default());
        let mut out = vec![Vec::new(); joints.len() + 2];
        for i in 0..(20.0 * rate) as usize {
            let seconds = i as f64 / rate;
            let angle = chirp(seconds) as f32;
            let mut motion = MotionParams::default();
            for joint in joints {
                motion.set_axis_angle(joint, Vec3::new(0.6, 0.8, 0.0) * angle);
            }
            motion.expression_mut()[7] = angle;
            motion.root_translation.x = angle;
            smoother.smooth(seconds, &mut motion, &Confidence::default());
            for (joint, out) in joints.into_iter().zip(&mut out) {
                let v = motion.axis_angle(joint);
                out.push(f64::from(v.x * 0.6 + v.y * 0.8));
            }
            out[joints.len()].push(f64::from(motion.expression()[7]));
            out[joints.len() + 1].push(f64::from(motion.root_translation.x));
        }
        let names = joints
            .iter()
            .map(|j| j.name())
            .chain(["expression", "root"]);
        for (name, out) in names.zip(&out) {
            let lag = lag_ms(out, rate);
            println!("{rate} Hz, {name}: {lag:.0} ms");
            assert!(lag <= 40.0, "{name} lags by {lag} ms at {rate} Hz");
        }
    }
}

#[test]
fn what_rests_is_held_still() {
    let mut random = Random(2);
    let mut smoother = Smoother::new(SmoothConfig::default());
    let mut sums = [0.0_f64; 2];
    let mut last = [0.0_f64; 2];
    for i in 0..600 {
        let noise = 0.01 * random.normal();
        let mut motion = MotionParams::default();
        motion.set_axis_angle(Joint::LeftElbow, Vec3::Y * (noise as f32 - 1.0));
        smoother.smooth(f64::from(i) / 30.0, &mut motion, &Confidence::default());
        let now = [
            noise - 1.0,
            f64::from(motion.axis_angle(Joint::LeftElbow).y),
        ];
        if i > 30 {
            for k in 0..2 {
                sums[k] += (now[k] - last[k]).abs();
            }
        }
        last = now;
    }
    println!("steps at rest: {:.2} of the noise's", sums[1] / sums[0]);
    assert!(sums[1] < 0.5 * sums[0], "noise passes: {sums:?}");
}

#[test]
fn an_unsure_joint_is_smoothed_more() {
    let after = |confidence: f32| {
        let mut smoother = Smoother::new(SmoothConfig::default());
        let mut sure = Confidence::default();
        sure.joints[Joint::LeftElbow.index()] = confidence;
        let mut motion = MotionParams::default();
        smoother.smooth(0.0, &mut motion, &sure);
        motion.set_axis_angle(Joint::LeftElbow, Vec3::Y * 0.1);
        smoother.smooth(0.033, &mut motion, &sure);
        motion.axis_angle(Joint::LeftElbow).y
    };
    assert!(
        after(0.0) < 0.6 * after(1.0),
        "an unsure step moves by {}, a sure one by {}",
        after(0.0),
        after(1.0)
    );
    assert!(
        after(f32::NAN) > 0.0,
        "a confidence without sense stops the joint"
    );
}

#[test]
fn times_and_motions_without_sense_leave_the_last_pose() {
    let mut smoother = Smoother::new(SmoothConfig::default());
    let mut motion = MotionParams::default();
    motion.values_mut()[100] = f32::NAN;
    smoother.smooth(0.0, &mut motion, &Confidence::default());
    assert!(motion.is_finite(), "a first motion without sense passes");
    let mut good = MotionParams::default();
    good.set_axis_angle(Joint::Head, Vec3::X);
    smoother.smooth(1.0, &mut good, &Confidence::default());
    for seconds in [f64::NAN, f64::INFINITY, 1.0, 0.99, 1.03] {
        let mut bad = MotionParams::default();
        bad.root_translation.y = f32::INFINITY;
        smoother.smooth(seconds, &mut bad, &Confidence::default());
        assert_eq!(bad.root_translation, Vec3::ZERO, "at {seconds}");
        assert!(
            (bad.axis_angle(Joint::Head).x - 1.0).abs() < 1e-5,
            "at {seconds}: the pose is lost"
        );
        let mut same = good.clone();
        smoother.smooth(seconds, &mut same, &Confidence::default());
        assert!(same.is_finite(), "at {seconds}");
    }
    // Long after, it begins anew and does not glide.
    let mut far = MotionParams::default();
    far.set_axis_angle(Joint::Head, -Vec3::X);
    smoother.smooth(100.0, &mut far, &Confidence::default());
    assert!(
        (far.axis_angle(Joint::Head).x + 1.0).abs() < 1e-5,
        "it glides after a pause"
    );
}

#[test]
fn a_whole_recording_is_smoothed_without_lag() {
    let rate = 30.0;
    let mut random = Random(5);
    let noisy = |i: usize, noise: f64| (chirp(i as f64 / rate) + 0.02 * noise) as f32;
    let mut frames: Vec<_> = (0..600)
        .map(|i| {
            let mut motion = MotionParams::default();
            let angle = noisy(i, random.normal());
            motion.set_axis_angle(Joint::LeftElbow, Vec3::Y * angle);
            motion.expression_mut()[3] = angle;
            motion.root_translation.z = angle;
            (i as f64 / rate, motion, Confidence::default())
        })
        .collect();
    let raw = frames.clone();
    smooth_all(&SmoothConfig::default(), &mut frames);
    type Part = fn(&MotionParams) -> f32;
    let parts: [(Part, f64); 3] = [
        (|motion| motion.axis_angle(Joint::LeftElbow).y, 0.9),
        (|motion| motion.expression()[3], 0.9),
        // What moves as fast as this is hardly smoothed: it must not become rougher.
        (|motion| motion.root_translation.z, 1.1),
    ];
    for (of, share) in parts {
        let values = |frames: &[(f64, MotionParams, Confidence)]| -> Vec<f64> {
            (frames.iter())
                .map(|(_, motion, _)| f64::from(of(motion)))
                .collect()
        };
        let rough = |values: &[f64]| -> f64 {
            let second = values.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs());
            second.sum()
        };
        let (smooth, raw) = (values(&frames), values(&raw));
        let lag = lag_ms(&smooth, rate);
        assert!(lag <= 2.0, "{lag} ms");
        let (left, all) = (rough(&smooth), rough(&raw));
        assert!(left < share * all, "{left} of {all} is left");
    }
    smooth_all(&SmoothConfig::default(), &mut []);
}
