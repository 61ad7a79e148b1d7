use crate::motions::{SESSION, assert_within_bounds};
use link_codec::{Codec, Decoder, Encoder, Micros, MotionFrame};
use std::fmt::Write;

/// Bytes that other programs rely on: they change only together with the codec's version.
const GOLDEN: &str = include_str!("golden.txt");

/// Sixteen frames made of sums and products only, which every machine rounds alike.
fn frames() -> impl Iterator<Item = MotionFrame> {
    (1u16..=16).map(|n| {
        let mut frame = MotionFrame {
            sequence: 0x0102_0300 + u32::from(n),
            captured: Micros(0x0001_0203_0405_0607 + 33_333 * u64::from(n) + u64::from(n * n % 7)),
            ..MotionFrame::default()
        };
        let n = f32::from(n);
        for (i, value) in (0u16..).zip(frame.motion.values_mut().iter_mut().skip(3)) {
            *value = (f32::from(i % 11) - 5.0) * (n * n + f32::from(i % 5)) / 1024.0;
        }
        frame.motion.root_translation = glam::Vec3::new(n / 8.0, 1.0, -n / 4.0);
        frame
    })
}

fn messages() -> Vec<(Codec, MotionFrame, String)> {
    let mut out = Vec::new();
    for codec in [Codec::Paper, Codec::Compact] {
        let mut encoder = Encoder::new(codec, SESSION);
        let mut message = Vec::new();
        for frame in frames() {
            encoder.encode(&frame, &mut message);
            encoder.acknowledge(frame.sequence.saturating_sub(2), u64::MAX);
            let hex = message.iter().fold(String::new(), |mut hex, byte| {
                write!(hex, "{byte:02x}").expect("a string takes what is written");
                hex
            });
            out.push((codec, frame, hex));
        }
    }
    out
}

#[test]
fn the_wire_has_not_changed() {
    let written = messages();
    let text: String = written
        .iter()
        .map(|(codec, _, hex)| format!("{codec} {hex}\n"))
        .collect();
    assert!(
        text == GOLDEN,
        "the codec writes other bytes than before. If that is meant, raise its version and put this in golden.txt:\n{text}"
    );
}

#[test]
fn golden_messages_decode_to_what_they_were_made_of() {
    let mut decoders = [Decoder::new(SESSION), Decoder::new(SESSION)];
    let frames: Vec<_> = frames().collect();
    assert_eq!(
        GOLDEN.lines().count(),
        2 * frames.len(),
        "a line for each frame and codec"
    );
    for (line, frame) in GOLDEN.lines().zip(frames.iter().cycle()) {
        let (codec, hex) = line.split_once(' ').expect("codec and bytes");
        let codec: Codec = codec.parse().expect("a codec's name");
        let message: Vec<u8> = (0..hex.len() / 2)
            .map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).expect("hexadecimal"))
            .collect();
        let shown = decoders[codec as usize]
            .decode(&message)
            .expect("golden messages decode");
        assert_eq!(
            (shown.sequence, shown.captured),
            (frame.sequence, frame.captured),
            "{line}"
        );
        assert_within_bounds(codec, &frame.motion, &shown.motion);
    }
}
