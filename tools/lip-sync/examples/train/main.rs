//! Trains the network of lip-sync and judges it.
//!
//!     tools/lip-sync/speech.py train train.bin; tools/lip-sync/speech.py held-out held.bin
//!     cargo run --release -p lip-sync --example train -- train.bin held.bin weights.bin
//!
//! With `fixture IN OUT` it turns what `speech.py fixture` wrote into the tests' file; with `judge held.bin` it judges the built-in network.

#![allow(
    clippy::cast_possible_truncation,
    reason = "sizes of a corpus that fits the memory"
)]

mod corpus;
mod learner;

use corpus::Utterance;
use lip_sync::CLASSES;
use lip_sync::front_end::{AHEAD, FrontEnd, INPUTS, STEP, WINDOW};
use lip_sync::network::{HIDDEN, Network, OUTPUTS};

/// Rounds over the corpus.
const ROUNDS: u32 = 9;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["fixture", from, to] => std::fs::write(to, corpus::fixture(&corpus::read(from)?))?,
        ["judge", held] => {
            judge(&Network::built_in()?, &corpus::read(held)?);
        }
        [train, held, weights] => {
            let (train, held) = (corpus::read(train)?, corpus::read(held)?);
            let mut learner = learner::Learner::new(1);
            for round in 0..ROUNDS {
                let loss = learner.learn(&train, round, ROUNDS);
                println!("round {round}: loss {loss:.4}");
                if round % 3 == 2 || round + 1 == ROUNDS {
                    let bytes = learner.network().write();
                    judge(&Network::read(&bytes)?, &held);
                    std::fs::write(weights, bytes)?;
                }
            }
        }
        _ => {
            return Err(
                "arguments: TRAIN HELD-OUT WEIGHTS, judge HELD-OUT, or fixture IN OUT".into(),
            );
        }
    }
    Ok(())
}

/// Calls `with` for each window of `sound` (16 kHz) with what the network sees and the middle of the window that is judged.
pub(crate) fn windows(sound: &[f32], mut with: impl FnMut(&[f32; INPUTS], usize)) {
    let mut front = FrontEnd::default();
    let mut seen = [0.0; INPUTS];
    for (k, sample) in sound.iter().enumerate() {
        if front.push(*sample)
            && let Some(middle) = (k + 1).checked_sub(WINDOW / 2 + AHEAD * STEP)
        {
            front.context(&mut seen);
            with(&seen, middle);
        }
    }
}

/// Prints how much of each class is told right.
fn judge(network: &Network, held: &[Utterance]) {
    let mut counts = [[0u32; OUTPUTS]; OUTPUTS];
    // Vowels as they are said, and those of which most windows are told right.
    let (mut said, mut right) = (0u32, 0u32);
    let mut neurons = [0.0; HIDDEN];
    for utterance in held {
        let (sound, marks) = utterance.at_16_khz(1.0);
        let mut told = vec![[0u32; OUTPUTS]; marks.len()];
        windows(&sound, |seen, middle| {
            let outputs = network.judge(seen, &mut neurons);
            let best = (0..OUTPUTS).max_by(|a, b| outputs[*a].total_cmp(&outputs[*b]));
            let best = best.unwrap_or(0);
            counts[corpus::class_at(&marks, middle)][best] += 1;
            let mark = marks.partition_point(|(at, _)| *at <= middle);
            if let Some(told) = mark.checked_sub(1).and_then(|mark| told.get_mut(mark)) {
                told[best] += 1;
            }
        });
        for (told, (_, class)) in told.iter().zip(&marks) {
            if (1..=5).contains(class) && told.iter().any(|count| *count > 0) {
                let most = (0..OUTPUTS).max_by_key(|k| told[*k]);
                said += 1;
                right += u32::from(most == Some(*class));
            }
        }
    }
    println!(
        "vowels of which most windows are right: {right} of {said}, {:.1} %",
        100.0 * f64::from(right) / f64::from(said.max(1))
    );
    for (class, row) in CLASSES.iter().zip(&counts) {
        println!("{class:>8} {row:?}");
    }
    let share = |classes: std::ops::RangeInclusive<usize>| {
        let right: u32 = classes.clone().map(|k| counts[k][k]).sum();
        let all: u32 = classes.map(|k| counts[k].iter().sum::<u32>()).sum();
        100.0 * f64::from(right) / f64::from(all.max(1))
    };
    println!(
        "right: vowels {:.1} %, mbp {:.1} %, fv {:.1} %, silence {:.1} %, all {:.1} %",
        share(1..=5),
        share(7..=7),
        share(6..=6),
        share(0..=0),
        share(0..=8)
    );
}
