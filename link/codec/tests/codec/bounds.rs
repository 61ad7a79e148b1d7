use crate::motions::{SESSION, assert_within_bounds};
use glam::Vec3;
use link_codec::{Codec, Decoder, Encoder, Micros, MotionFrame};
use proptest::prelude::*;
use spmm3::{Joint, MotionParams, PARAMS};
use std::f32::consts::{PI, TAU};

/// Any rotation of at most a full turn, often close to none, the half turn and the full turn.
fn rotation() -> impl Strategy<Value = Vec3> {
    let angle = prop_oneof![
        0.0..TAU,
        Just(0.0),
        PI - 0.001..PI + 0.001,
        Just(PI),
        TAU - 0.001..TAU
    ];
    (angle, -1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0)
        .prop_map(|(angle, x, y, z)| Vec3::new(x, y, z).normalize_or(Vec3::Y) * angle)
}

fn motion() -> impl Strategy<Value = MotionParams> {
    let rotations = proptest::collection::vec(rotation(), 55);
    let expression = proptest::collection::vec(-8.0f32..=8.0, 50);
    let translation = (-1000.0f32..=1000.0, -1000.0f32..=1000.0, -12.0f32..12.0);
    (rotations, expression, translation).prop_map(|(rotations, expression, (x, y, z))| {
        let mut motion = MotionParams::new([0.0; PARAMS], Vec3::new(x, y, z));
        for (joint, rotation) in Joint::ALL.into_iter().zip(rotations) {
            motion.set_axis_angle(joint, rotation);
        }
        motion.expression_mut().copy_from_slice(&expression);
        motion
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_sequence_of_motions_comes_back_within_the_bounds(
        motions in proptest::collection::vec(motion(), 1..14),
        first in 1u32..u32::MAX - 20,
        period in 1u64..1 << 45,
    ) {
        for codec in [Codec::Paper, Codec::Compact] {
            let (mut encoder, mut decoder) = (Encoder::new(codec, SESSION), Decoder::new(SESSION));
            let mut message = Vec::new();
            for (i, motion) in motions.iter().enumerate() {
                let sequence = first + u32::try_from(i).expect("few motions");
                let captured = Micros(period * (i as u64 + 1));
                encoder.encode(&MotionFrame { sequence, captured, motion: motion.clone() }, &mut message);
                let shown = decoder.decode(&message).expect("an undisturbed stream decodes");
                prop_assert_eq!((shown.sequence, shown.captured), (sequence, captured));
                assert_within_bounds(codec, motion, &shown.motion);
                let (newest, received) = decoder.feedback();
                encoder.acknowledge(newest, received);
            }
        }
    }
}

#[test]
fn values_that_are_nan_or_out_of_range_are_corrected_and_counted() {
    for codec in [Codec::Paper, Codec::Compact] {
        let (mut encoder, mut decoder) = (Encoder::new(codec, SESSION), Decoder::new(SESSION));
        let mut motion = MotionParams::new([f32::NAN; PARAMS], Vec3::new(f32::INFINITY, -1e9, 1.0));
        motion.set_axis_angle(Joint::Head, Vec3::X * 1e20);
        motion.expression_mut()[0] = -9.0;
        let mut message = Vec::new();
        encoder.encode(
            &MotionFrame {
                sequence: 1,
                captured: Micros(1),
                motion,
            },
            &mut message,
        );
        let shown = decoder
            .decode(&message)
            .expect("what was corrected decodes")
            .motion;
        let mut expected = MotionParams::new([0.0; PARAMS], Vec3::new(1000.0, -1000.0, 1.0));
        expected.expression_mut()[0] = -8.0;
        assert_within_bounds(codec, &expected, &shown);
        assert_eq!(
            encoder.corrected(),
            55 + 50 + 2,
            "joints, coefficients and coordinates were counted"
        );
    }
}

#[test]
fn a_spin_through_the_half_turn_costs_no_more_bytes_than_one_away_from_it() {
    let cost = |from: f32| {
        let mut encoder = Encoder::new(Codec::Compact, SESSION);
        let (mut message, mut bytes) = (Vec::new(), 0);
        for sequence in 1..60u32 {
            let mut motion = MotionParams::default();
            motion.set_axis_angle(Joint::Pelvis, Vec3::Y * (from + 0.03 * sequence as f32));
            let captured = Micros(u64::from(sequence) * 33_333);
            encoder.encode(
                &MotionFrame {
                    sequence,
                    captured,
                    motion,
                },
                &mut message,
            );
            encoder.acknowledge(sequence, u64::MAX);
            bytes += message.len();
        }
        bytes
    };
    let (clear, through) = (cost(0.0), cost(2.2));
    assert!(
        through <= clear + 60,
        "{through} bytes through the half turn, {clear} clear of it"
    );
}
