use crate::motions::{SESSION, lively};
use link_codec::decode_error::DecodeError;
use link_codec::{Codec, Decoder, Encoder, Micros, MotionFrame};
use spmm3::PARAMS;

fn encode(codec: Codec, frame: &MotionFrame) -> Vec<u8> {
    let mut message = Vec::new();
    Encoder::new(codec, SESSION).encode(frame, &mut message);
    message
}

/// A stored `paper` message in which FP16 value `index` is `bits`, or the root's x is `x`.
fn stored(index: usize, bits: u16, x: f32) -> Vec<u8> {
    let mut message = encode(Codec::Paper, &lively(1));
    message.truncate(18);
    message.push(0);
    let mut body = vec![0; 2 * PARAMS + 12];
    body[2 * index..2 * index + 2].copy_from_slice(&bits.to_le_bytes());
    body[2 * PARAMS..2 * PARAMS + 4].copy_from_slice(&x.to_le_bytes());
    message.extend(body);
    message
}

fn refused(message: &[u8]) -> DecodeError {
    let mut decoder = Decoder::new(SESSION);
    let error = decoder.decode(message).expect_err("this must be refused");
    assert_eq!(decoder.errors().of(error), 1, "{error} is counted");
    assert_eq!(decoder.feedback(), (0, 0), "{error} leaves no trace");
    error
}

#[test]
fn every_kind_of_damage_is_refused_with_its_own_reason() {
    let paper = encode(Codec::Paper, &lively(5));
    let compact = encode(Codec::Compact, &lively(5));
    let with = |message: &[u8], at: usize, byte: u8| {
        let mut message = message.to_vec();
        message[at] = byte;
        message
    };
    assert_eq!(refused(&[]), DecodeError::Length, "an empty message");
    assert_eq!(
        refused(&with(&paper, 0, 16)),
        DecodeError::Kind,
        "feedback is no motion"
    );
    assert_eq!(
        refused(&with(&paper, 1, 9)),
        DecodeError::Version,
        "paper of the future"
    );
    assert_eq!(
        refused(&with(&compact, 3, 0x90)),
        DecodeError::Version,
        "compact of the future"
    );
    assert_eq!(refused(&paper[..12]), DecodeError::Length, "half a header");
    assert_eq!(refused(&compact[..5]), DecodeError::Length, "half a header");
    assert_eq!(
        refused(&[&compact[..], &[7; 40]].concat()),
        DecodeError::Length,
        "a tail"
    );
    assert_eq!(
        refused(&[&compact[..], &[0]].concat()),
        DecodeError::Length,
        "a zero that says nothing"
    );
    assert_eq!(
        refused(&with(&paper, 18, 1)[..40]),
        DecodeError::Lz4,
        "half a block"
    );
    assert_eq!(
        refused(&stored(3, 0x7e00, 0.0)),
        DecodeError::NotFinite,
        "NaN"
    );
    assert_eq!(
        refused(&stored(3, 0x7c00, 0.0)),
        DecodeError::NotFinite,
        "infinity"
    );
    assert_eq!(
        refused(&stored(3, 0x4400, 0.0)),
        DecodeError::AngleRange,
        "four radians"
    );
    assert_eq!(
        refused(&stored(80, 0x4c00, 0.0)),
        DecodeError::ExpressionRange,
        "sixteen units"
    );
    assert_eq!(
        refused(&stored(3, 0, 1001.0)),
        DecodeError::TranslationRange,
        "a kilometre away"
    );
    assert_eq!(
        refused(&with(&paper, 2, !paper[2])),
        DecodeError::ForeignSession,
        "paper of another session"
    );
    assert_eq!(
        refused(&with(&compact, 1, !compact[1])),
        DecodeError::ForeignSession,
        "compact of another session"
    );
    assert_eq!(
        refused(&with(&compact, 40, !compact[40])),
        DecodeError::Corrupt,
        "a damaged number"
    );
}

#[test]
fn foreign_sessions_are_refused_whatever_their_number() {
    let mut passed = 0;
    for session in 0..3000 {
        let mut message = Vec::new();
        Encoder::new(Codec::Compact, session).encode(&lively(1), &mut message);
        passed += u32::from(Decoder::new(SESSION).decode(&message).is_ok());
    }
    assert_eq!(
        passed, 0,
        "session check and checksum together miss one in sixteen million"
    );
}

#[test]
fn order_is_judged_by_sequence_and_time() {
    for codec in [Codec::Paper, Codec::Compact] {
        let mut decoder = Decoder::new(SESSION);
        let mut send = |frame: &MotionFrame| {
            decoder
                .decode(&encode(codec, frame))
                .map(|frame| frame.sequence)
        };
        assert_eq!(send(&lively(100)), Ok(100), "{codec}: the first");
        assert_eq!(
            send(&lively(100)),
            Err(DecodeError::Replayed),
            "{codec}: the first again"
        );
        assert_eq!(
            send(&lively(36)),
            Ok(36),
            "{codec}: the oldest of the window"
        );
        assert_eq!(
            send(&lively(35)),
            Err(DecodeError::Late),
            "{codec}: older than the window"
        );
        assert_eq!(
            send(&lively(0)),
            Err(DecodeError::Late),
            "{codec}: no frame has sequence 0"
        );
        let mut early = lively(101);
        early.captured = Micros(lively(99).captured.0);
        assert_eq!(
            send(&early),
            Err(DecodeError::TimeBackwards),
            "{codec}: newer, yet captured before"
        );
        let mut late = lively(99);
        late.captured = Micros(lively(102).captured.0);
        assert_eq!(
            send(&late),
            Err(DecodeError::TimeBackwards),
            "{codec}: older, yet captured after"
        );
        assert_eq!(send(&lively(99)), Ok(99), "{codec}: out of order, but new");
        assert_eq!(decoder.feedback(), (100, 1 | 1 << 63), "{codec}: what came");
    }
}

#[test]
fn a_prediction_from_a_frame_that_is_not_here_is_refused() {
    let mut encoder = Encoder::new(Codec::Compact, SESSION);
    let mut message = Vec::new();
    encoder.encode(&lively(1), &mut message);
    encoder.acknowledge(1, 0);
    encoder.encode(&lively(2), &mut message);
    assert_eq!(
        refused(&message),
        DecodeError::Reference,
        "frame 1 never came"
    );
}

#[test]
fn a_predicted_frame_played_again_much_later_is_not_shown() {
    let (mut encoder, mut decoder) = (Encoder::new(Codec::Compact, SESSION), Decoder::new(SESSION));
    let mut old = Vec::new();
    let mut message = Vec::new();
    for sequence in 1..=700 {
        encoder.encode(&lively(sequence), &mut message);
        decoder
            .decode(&message)
            .expect("an undisturbed stream decodes");
        let (newest, received) = decoder.feedback();
        encoder.acknowledge(newest, received);
        old.push(message.clone());
        if sequence % 50 == 0 {
            for replayed in &old {
                decoder.decode(replayed).expect_err("it has come before");
            }
        }
    }
}
