//! What the network tells of voices and sentences that it was not trained with, of which `speech.py fixture` and espeak-ng's own phoneme events
//! made `held_out.bin`: 16 kHz, 8 bits by the mu-law.

use lip_sync::front_end::{AHEAD, FrontEnd, INPUTS, STEP, WINDOW};
use lip_sync::network::{HIDDEN, Network, OUTPUTS};
use lip_sync::{CLASSES, Listener, Mouth};

/// Sound, and at which sample each class begins.
struct Utterance {
    sound: Vec<f32>,
    marks: Vec<(usize, usize)>,
}

impl Utterance {
    fn class_at(&self, sample: usize) -> usize {
        let after = self.marks.partition_point(|(at, _)| *at <= sample);
        after.checked_sub(1).map_or(0, |k| self.marks[k].1)
    }
}

fn held_out() -> Vec<Utterance> {
    let mut rest: &[u8] = include_bytes!("held_out.bin");
    let mut take = |count: usize| {
        let (part, after) = rest.split_at(count);
        rest = after;
        (part.to_vec(), rest.is_empty())
    };
    let number = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().expect("four bytes")) as usize;
    let mut all = Vec::new();
    loop {
        let count = number(&take(4).0);
        let sound = take(count).0.into_iter().map(|byte| {
            let curve = (f32::from(byte) - 128.0) / 127.0;
            ((256f32.powf(curve.abs()) - 1.0) / 255.0).copysign(curve)
        });
        let sound = sound.collect();
        let marks = number(&take(4).0);
        let (bytes, is_last) = take(5 * marks);
        let marks = bytes.chunks_exact(5);
        let marks = marks.map(|mark| (number(&mark[..4]), usize::from(mark[4])));
        let marks = marks.collect();
        all.push(Utterance { sound, marks });
        if is_last {
            return all;
        }
    }
}

#[test]
fn four_in_five_vowels_and_most_closed_lips_of_unknown_voices_are_told() {
    let network = Network::built_in().expect("its weights");
    let mut counts = [[0u32; OUTPUTS]; OUTPUTS];
    let (mut seen, mut neurons) = ([0.0; INPUTS], [0.0; HIDDEN]);
    for utterance in held_out() {
        let mut front = FrontEnd::default();
        for (k, sample) in utterance.sound.iter().enumerate() {
            let Some(middle) = (k + 1).checked_sub(WINDOW / 2 + AHEAD * STEP) else {
                front.push(*sample);
                continue;
            };
            if front.push(*sample) {
                front.context(&mut seen);
                let outputs = network.judge(&seen, &mut neurons);
                let best = (0..OUTPUTS).max_by(|a, b| outputs[*a].total_cmp(&outputs[*b]));
                counts[utterance.class_at(middle)][best.expect("classes")] += 1;
            }
        }
    }
    let share = |classes: std::ops::RangeInclusive<usize>| {
        let right: u32 = classes.clone().map(|k| counts[k][k]).sum();
        let all: u32 = classes.map(|k| counts[k].iter().sum::<u32>()).sum();
        (f64::from(right) / f64::from(all), all)
    };
    let ((vowels, frames), (lips, closed)) = (share(1..=5), share(7..=7));
    for (class, row) in CLASSES.iter().zip(&counts) {
        println!("{class:>8} {row:?}");
    }
    println!("{vowels:.3} of {frames} frames of vowels, {lips:.3} of {closed} of closed lips");
    assert!(frames > 500 && closed > 50, "{frames} and {closed} frames");
    assert!(vowels >= 0.8, "{vowels} of the vowels");
    assert!(lips >= 0.6, "{lips} of the closed lips");
}

#[test]
fn lips_close_for_b_more_than_for_vowels_and_rest_in_silence_at_any_loudness() {
    for gain in [0.1, 1.0] {
        let mut listener = Listener::new().expect("its weights");
        let (mut open, mut closed) = ((0.0, 0u32), (0.0, 0u32));
        for utterance in held_out() {
            for (k, chunk) in utterance.sound.chunks(STEP).enumerate() {
                let thrice: Vec<f32> = chunk.iter().flat_map(|s| [gain * s; 3]).collect();
                let mouth = listener.hear(&thrice);
                // Where the mouth is that was heard of: three windows and a half earlier, and as much for its own inertia.
                let class = utterance.class_at(((k + 1) * STEP).saturating_sub(5 * STEP));
                let sum = match CLASSES[class] {
                    "a" | "e" | "o" => &mut open,
                    "mbp" => &mut closed,
                    _ => continue,
                };
                *sum = (sum.0 + mouth.opening(), sum.1 + 1);
            }
        }
        let [open, closed] = [open, closed].map(|(sum, count)| sum / count as f32);
        println!("open {open} for vowels, {closed} for m, b and p");
        assert!(open > 0.35, "{open} for vowels at {gain}");
        assert!(
            closed < 0.55 * open,
            "{closed} for m, b and p, {open} for vowels"
        );
        let mouth = listener.hear(&vec![0.0; 48_000]);
        assert!(mouth.opening() < 0.02, "{mouth:?} in silence");
        listener.silence();
        assert_eq!(listener.hear(&[]), Mouth::default(), "silenced");
    }
}

#[test]
fn what_is_no_sound_does_no_harm() {
    let mut listener = Listener::new().expect("its weights");
    let bad = [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30, -1e30];
    let mouth = listener.hear(&bad.repeat(5000));
    assert!(
        mouth.weights.iter().all(|w| (0.0..=1.0).contains(w)),
        "{mouth:?}"
    );
}
