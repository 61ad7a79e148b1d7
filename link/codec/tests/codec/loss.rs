use crate::motions::{SESSION, assert_within_bounds, lively};
use link_codec::decode_error::DecodeError;
use link_codec::{Codec, Decoder, Encoder};
use std::collections::VecDeque;

/// A call over a network that loses, delays, reorders and doubles messages and loses feedback.
fn call(codec: Codec, loss: f64, seed: u64) {
    let mut random = fastrand::Rng::with_seed(seed);
    let (mut encoder, mut decoder) = (Encoder::new(codec, SESSION), Decoder::new(SESSION));
    let mut forth: Vec<(u32, Vec<u8>)> = Vec::new();
    let mut back = VecDeque::new();
    let mut message = Vec::new();
    let (mut shown_frames, mut refused) = (0, 0);
    let last = 600;
    for now in 1..=last {
        // An outage in mid-call, and a clean end.
        let outage = (200..310).contains(&now);
        let clean = now > 500;
        let lost = |random: &mut fastrand::Rng| !clean && (outage || random.f64() < loss);
        encoder.encode(&lively(now), &mut message);
        for _ in 0..if random.f64() < 0.05 { 2 } else { 1 } {
            if !lost(&mut random) {
                let late = if clean {
                    0
                } else {
                    random.u32(0..4) + if random.f64() < 0.01 { 90 } else { 0 }
                };
                forth.push((now + late, message.clone()));
            }
        }
        let (due, rest): (Vec<_>, Vec<_>) = forth.into_iter().partition(|(due, _)| *due <= now);
        forth = rest;
        for (_, message) in due {
            let before = decoder.feedback();
            match decoder.decode(&message) {
                Ok(shown) => {
                    let sent = lively(shown.sequence);
                    assert_eq!(shown.captured, sent.captured, "the capture time is exact");
                    assert_within_bounds(codec, &sent.motion, &shown.motion);
                    shown_frames += 1;
                }
                Err(error) => {
                    let expected = [
                        DecodeError::Replayed,
                        DecodeError::Late,
                        DecodeError::Reference,
                        DecodeError::Corrupt,
                        DecodeError::TimeBackwards,
                    ];
                    assert!(expected.contains(&error), "{error}");
                    assert_eq!(
                        decoder.feedback(),
                        before,
                        "a refused message leaves no trace"
                    );
                    refused += 1;
                }
            }
        }
        if clean && now > 520 {
            assert_eq!(
                decoder.feedback().0,
                now,
                "a clean network shows every frame"
            );
        }
        if now % 2 == 0 && !lost(&mut random) {
            back.push_back((now + 3, decoder.feedback()));
        }
        while back.front().is_some_and(|(due, _)| *due <= now) {
            if let Some((_, (newest, received))) = back.pop_front() {
                encoder.acknowledge(newest, received);
            }
        }
    }
    assert_eq!(
        decoder.errors().total(),
        refused,
        "each error is counted once"
    );
    let least = f64::from(last - 110) * (1.0 - loss) * 0.9;
    assert!(
        f64::from(shown_frames) > least,
        "{codec} at {loss}: {shown_frames} frames shown"
    );
}

#[test]
fn loss_reordering_and_outages_never_show_a_wrong_frame_and_the_stream_recovers() {
    for codec in [Codec::Paper, Codec::Compact] {
        for (seed, loss) in [0.0, 0.01, 0.05, 0.1, 0.3, 0.5].into_iter().enumerate() {
            call(codec, loss, seed as u64);
        }
    }
}

#[test]
fn without_any_feedback_every_frame_is_a_key_frame_of_less_than_a_packet() {
    let mut encoder = Encoder::new(Codec::Compact, SESSION);
    let mut message = Vec::new();
    for sequence in (1..200).step_by(7) {
        encoder.encode(&lively(sequence), &mut message);
        assert!(message.len() < 500, "{} bytes", message.len());
        let shown = Decoder::new(SESSION)
            .decode(&message)
            .expect("a key frame needs no other");
        assert_within_bounds(Codec::Compact, &lively(sequence).motion, &shown.motion);
    }
}
