//! The built-in network on voices and sentences that it was not trained with: speech by espeak-ng, whose phonemes are known (`speech.py fixture`).

use lip_sync::CLASSES;
use lip_sync::front_end::{AHEAD, FrontEnd, INPUTS, RATE, STEP, WINDOW};
use lip_sync::network::{HIDDEN, Network, OUTPUTS};
use lip_sync::{Listener, SHAPES};

/// A sentence: sound of 16 kHz, and at which sample each class begins.
struct Utterance {
    sound: Vec<f32>,
    marks: Vec<(usize, usize)>,
}

/// Reads what the example `train` wrote (`corpus::fixture`): mu-law (ITU-T G.711's curve), undone here.
fn utterances() -> Vec<Utterance> {
    let mut rest: &[u8] = include_bytes!("held_out.bin");
    let mut all = Vec::new();
    fn take<'a>(rest: &mut &'a [u8], count: usize) -> &'a [u8] {
        let (part, after) = rest.split_at(count);
        *rest = after;
        part
    }
    fn number(rest: &mut &[u8]) -> usize {
        u32::from_le_bytes(take(rest, 4).try_into().expect("four")) as usize
    }
    while !rest.is_empty() {
        let count = number(&mut rest);
        let sound = take(&mut rest, count).iter().map(|byte| {
            let curve = (f32::from(*byte) - 128.0) / 127.0;
            ((256f32.ln() * curve.abs()).exp() - 1.0) / 255.0 * curve.signum()
        });
        let sound = sound.collect();
        let marks = (0..number(&mut rest))
            .map(|_| (number(&mut rest), usize::from(take(&mut rest, 1)[0])))
            .collect();
        all.push(Utterance { sound, marks });
    }
    all
}

/// The mark that a sample belongs to.
fn mark_at(marks: &[(usize, usize)], sample: usize) -> Option<usize> {
    marks.iter().rposition(|(at, _)| *at <= sample)
}

/// The most frequent class.
fn most(told: &[u32; OUTPUTS]) -> usize {
    (0..OUTPUTS)
        .max_by_key(|class| told[*class])
        .expect("classes")
}

#[test]
fn four_of_five_vowels_are_told_right() {
    let network = Network::built_in().expect("the weights are whole");
    // What was told in the windows of each phoneme, by its class.
    let mut phonemes: Vec<(usize, [u32; OUTPUTS])> = Vec::new();
    let all = utterances();
    for utterance in &all {
        let (mut front, mut seen) = (FrontEnd::default(), [0.0; INPUTS]);
        let mut neurons = [0.0; HIDDEN];
        let first = phonemes.len();
        let marks = utterance.marks.iter();
        phonemes.extend(marks.map(|(_, class)| (*class, [0; OUTPUTS])));
        for (k, sample) in utterance.sound.iter().enumerate() {
            if !front.push(*sample) {
                continue;
            }
            let middle = (k + 1).checked_sub(WINDOW / 2 + AHEAD * STEP);
            let Some(mark) = middle.and_then(|at| mark_at(&utterance.marks, at)) else {
                continue;
            };
            front.context(&mut seen);
            let outputs = network.judge(&seen, &mut neurons);
            let best = (0..OUTPUTS).max_by(|a, b| outputs[*a].total_cmp(&outputs[*b]));
            phonemes[first + mark].1[best.expect("classes")] += 1;
        }
    }
    phonemes.retain(|(_, told)| told.iter().sum::<u32>() > 0);
    // Of phonemes of these classes, how many are told right in most of their windows, and how many there are.
    let right = |classes: &[&str]| {
        let is_one = |class: usize| classes.contains(&CLASSES[class]);
        let all: Vec<_> = phonemes
            .iter()
            .filter(|(class, _)| is_one(*class))
            .collect();
        let hit = all
            .iter()
            .filter(|(class, told)| most(told) == *class)
            .count();
        (100.0 * hit as f64 / all.len() as f64, all.len())
    };
    let (vowels, count) = right(&["a", "e", "i", "o", "u"]);
    let ((lips, _), (silence, _)) = (right(&["mbp"]), right(&["silence"]));
    println!(
        "{} sentences: {vowels:.1} % of {count} vowels are told right; closed lips {lips:.1} %, silence {silence:.1} %",
        all.len()
    );
    assert!(count > 100, "{count} vowels");
    assert!(vowels >= 80.0, "{vowels:.1} % of vowels");
    assert!(
        lips > 50.0 && silence > 60.0,
        "lips {lips:.1} %, silence {silence:.1} %"
    );
}

#[test]
fn a_mouth_moves_with_speech_and_is_shut_without() {
    let mut listener = Listener::new().expect("the weights are whole");
    let open = |listener: &mut Listener, sound: &[f32]| -> f32 {
        // 48 kHz, each sample three times as long: what the listener's own filter takes off again.
        let sound: Vec<f32> = sound.iter().flat_map(|sample| [*sample; 3]).collect();
        let mut widest = 0.0f32;
        for piece in sound.chunks(960) {
            let mouth = listener.hear(piece);
            let vowels = &mouth.weights[..5];
            assert!(
                mouth.weights.iter().all(|w| (0.0..=1.0).contains(w)),
                "{mouth:?}"
            );
            widest = vowels.iter().copied().fold(widest, f32::max);
        }
        widest
    };
    assert_eq!(SHAPES.len(), 7);
    for utterance in utterances().iter().take(4) {
        let widest = open(&mut listener, &utterance.sound);
        assert!(widest > 0.5, "speech opens it by {widest}");
        let silence = vec![0.0; RATE as usize / 2];
        open(&mut listener, &silence);
        let shut = open(&mut listener, &silence);
        assert!(shut < 0.05, "silence leaves it open by {shut}");
    }
}
