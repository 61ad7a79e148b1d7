//! Damaged and made-up messages: a decoder refuses them, and never panics. Apart from the codec's other tests because it takes an
//! emulator eight minutes, and what it looks for depends on no processor.

#[expect(dead_code, reason = "the other tests use the rest")]
mod motions;

use fastrand::Rng;
use link_codec::{Codec, Decoder, Encoder, MotionFrame};
use motions::{SESSION, lively};

/// Messages of a stream: those already shown, and the next.
struct Stream {
    shown: Vec<Vec<u8>>,
    next: Vec<u8>,
    frame: MotionFrame,
}

impl Stream {
    fn new(codec: Codec, frames: u32) -> Self {
        let (mut encoder, mut decoder) = (Encoder::new(codec, SESSION), Decoder::new(SESSION));
        let mut shown = Vec::new();
        let mut next = Vec::new();
        for sequence in 1..=frames {
            encoder.encode(&lively(sequence), &mut next);
            decoder
                .decode(&next)
                .expect("an undisturbed stream decodes");
            shown.push(next.clone());
            let (newest, received) = decoder.feedback();
            encoder.acknowledge(newest, received);
        }
        encoder.encode(&lively(frames + 1), &mut next);
        let frame = decoder
            .decode(&next)
            .expect("an undisturbed stream decodes");
        Self { shown, next, frame }
    }

    fn decoder(&self) -> Decoder {
        let mut decoder = Decoder::new(SESSION);
        for message in &self.shown {
            decoder
                .decode(message)
                .expect("an undisturbed stream decodes");
        }
        decoder
    }

    /// Some message, damaged in some way.
    fn mutate(&self, random: &mut Rng, out: &mut Vec<u8>) {
        out.clear();
        out.extend_from_slice(if random.bool() {
            &self.next
        } else {
            &self.shown[random.usize(..self.shown.len())]
        });
        match random.u8(..8) {
            0 => out.truncate(random.usize(..=out.len())),
            1 => {
                let longest = random.usize(1..1500);
                let more = 1 + random.usize(..longest);
                out.extend(std::iter::repeat_with(|| random.u8(..)).take(more));
            }
            2 => {
                let other = &self.shown[random.usize(..self.shown.len())];
                out.truncate(random.usize(..=out.len()));
                out.extend_from_slice(&other[random.usize(..=other.len())..]);
            }
            3 => {
                let kind = out[0];
                out.iter_mut().for_each(|byte| *byte = random.u8(..));
                out[0] = kind;
            }
            4 => {
                let (from, byte) = (
                    random.usize(..out.len()),
                    [0, 0xff, 0x7f, 0x80][random.usize(..4)],
                );
                let until = (from + random.usize(1..20)).min(out.len());
                out[from..until].fill(byte);
            }
            _ => {
                for _ in 0..random.usize(1..5) {
                    // Headers decide most: hit them more often.
                    let reach = if random.bool() {
                        out.len()
                    } else {
                        out.len().min(24)
                    };
                    out[random.usize(..reach)] ^= 1 << random.u8(..8);
                }
            }
        }
    }
}

fn fuzz(stream: &Stream, count: u64, seed: u64) {
    let mut random = Rng::with_seed(seed);
    let mut decoder = stream.decoder();
    let mut message = Vec::new();
    for n in 0..count {
        stream.mutate(&mut random, &mut message);
        let before = decoder.feedback();
        match decoder.decode(&message) {
            Ok(frame) => {
                assert!(frame.motion.is_finite(), "what is shown is numbers");
                decoder = stream.decoder();
            }
            Err(_) => assert_eq!(
                decoder.feedback(),
                before,
                "a refused message leaves no trace"
            ),
        }
        if n % 5000 == 4999 {
            let next = decoder.decode(&stream.next).expect("the stream goes on");
            assert_eq!(
                next, stream.frame,
                "refused messages have changed what is shown"
            );
            decoder = stream.decoder();
        }
    }
}

#[test]
fn ten_million_damaged_messages_neither_panic_nor_leave_a_trace() {
    let paper = Stream::new(Codec::Paper, 3);
    let compact = Stream::new(Codec::Compact, 30);
    std::thread::scope(|scope| {
        for seed in 0..4 {
            let (paper, compact) = (&paper, &compact);
            scope.spawn(move || {
                fuzz(paper, 1_500_000, seed);
                fuzz(compact, 1_000_000, 100 + seed);
            });
        }
    });
}
