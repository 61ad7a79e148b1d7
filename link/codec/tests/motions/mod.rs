//! Test motions, and their error after decoding, computed in f64.

use glam::{DMat3, DVec3, Vec3};
use link_codec::{Codec, Micros, MotionFrame};
use spmm3::{Joint, MotionParams};
use std::f64::consts::{PI, TAU};

pub(crate) const SESSION: u32 = 0xc0de_cafe;

/// A lively frame at 30 Hz: everything moves, and the pelvis spins round and round.
pub(crate) fn lively(sequence: u32) -> MotionFrame {
    let t = sequence as f32 / 30.0;
    let mut motion = MotionParams::default();
    for (i, joint) in Joint::ALL.into_iter().enumerate() {
        let phase = i as f32 * 0.7;
        let swing = Vec3::new(
            (2.0 * t + phase).sin(),
            (1.3 * t - phase).cos(),
            (0.7 * t).sin(),
        );
        motion.set_axis_angle(joint, swing * 0.4);
    }
    motion.set_axis_angle(
        Joint::Pelvis,
        Vec3::new(0.1, 1.0, 0.0).normalize() * (3.0 * t % std::f32::consts::TAU),
    );
    for (i, value) in motion.expression_mut().iter_mut().enumerate() {
        *value = 2.0 * (3.0 * t + i as f32).sin();
    }
    motion.root_translation = Vec3::new(10.0 * t.sin(), 0.9, -20.0 + t);
    MotionFrame {
        sequence,
        captured: Micros(
            5_000_000_000 + u64::from(sequence) * 33_333 + u64::from(sequence * 7919 % 150),
        ),
        motion,
    }
}

/// Rodrigues' formula.
fn matrix(v: DVec3) -> DMat3 {
    let angle = v.length();
    if angle == 0.0 {
        return DMat3::IDENTITY;
    }
    let k = v / angle;
    let cross = DMat3::from_cols(
        DVec3::new(0.0, k.z, -k.y),
        DVec3::new(-k.z, 0.0, k.x),
        DVec3::new(k.y, -k.x, 0.0),
    );
    DMat3::IDENTITY + cross * angle.sin() + cross * cross * (1.0 - angle.cos())
}

/// The angle between two rotations, from the Frobenius norm of their matrices' difference, 2 sqrt(2) sin(angle / 2).
fn angle_between(a: DVec3, b: DVec3) -> f64 {
    let difference = matrix(a) - matrix(b);
    let squared: f64 = difference.to_cols_array().iter().map(|x| x * x).sum();
    2.0 * (squared.sqrt() / 8f64.sqrt()).min(1.0).asin()
}

/// Asserts the codec's stated bounds.
pub(crate) fn assert_within_bounds(codec: Codec, sent: &MotionParams, shown: &MotionParams) {
    let (degrees, metres, coefficient) = match codec {
        Codec::Paper => (0.1, 0.000_1, 16.0 / 4096.0),
        Codec::Compact => (0.5, 0.000_5, 16.0 / 1024.0),
    };
    for joint in Joint::ALL {
        let (a, b) = (
            sent.axis_angle(joint).as_dvec3(),
            shown.axis_angle(joint).as_dvec3(),
        );
        let error = angle_between(a, b).to_degrees();
        assert!(
            error <= degrees,
            "{codec}: {} is {error} degrees off: {a} {b}",
            joint.name()
        );
        assert!(
            b.length() <= PI + 0.01,
            "{codec}: {} has not its shortest vector",
            joint.name()
        );
        // The vectors of the sent rotation that are at most a half turn long, give or take the error.
        let length = a.length();
        let nearest = (-3..=3)
            .map(|turns| {
                if length > 0.0 {
                    a * (1.0 + f64::from(turns) * TAU / length)
                } else {
                    a
                }
            })
            .map(|alias| (alias - b).abs().max_element().to_degrees())
            .fold(f64::INFINITY, f64::min);
        assert!(
            nearest <= degrees,
            "{codec}: a component of {} is {nearest} degrees off",
            joint.name()
        );
    }
    let root = (sent.root_translation.as_dvec3() - shown.root_translation.as_dvec3()).length();
    assert!(root <= metres, "{codec}: the root is {root} m off");
    for (a, b) in sent.expression().iter().zip(shown.expression()) {
        let error = (f64::from(*a) - f64::from(*b)).abs();
        assert!(
            error <= coefficient,
            "{codec}: a coefficient is {error} off"
        );
    }
}
