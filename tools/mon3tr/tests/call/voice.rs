//! What one side says is what the other hears, between real processes.

use crate::house::{House, count, through};
use netlab::{Impairment, Loss, Probability};
use std::time::Duration;

/// Samples a second of voice.
const RATE: usize = link_voice::RATE as usize;
/// Samples of a loudness: 20 ms.
const WINDOW: usize = RATE / 50;
/// Of the file, seconds.
const SPOKEN: usize = 5;

/// Syllables of 150 ms at 120 Hz, of which a fixed half is loud: no part of them looks like another.
fn syllables() -> Vec<f32> {
    let mut random = 1u32;
    let mut loud = 0.0;
    (0..SPOKEN * RATE)
        .map(|k| {
            let within = (k % (RATE * 3 / 20)) as f32 / (RATE * 3 / 20) as f32;
            if within == 0.0 {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                loud = if random >> 31 == 0 { 0.5 } else { 0.03 };
            }
            let phase = (k as f32 * 120.0 / RATE as f32).fract();
            loud * (within * std::f32::consts::PI).sin()
                * (-6.0 * phase).exp()
                * (phase * 30.0).sin()
        })
        .collect()
}

fn loudness(samples: &[f32]) -> Vec<f32> {
    let (windows, _) = samples.as_chunks::<WINDOW>();
    windows
        .iter()
        .map(|window| (window.iter().map(|s| s * s).sum::<f32>() / WINDOW as f32).sqrt())
        .collect()
}

/// Correlation of two loudnesses.
fn likeness(a: &[f32], b: &[f32]) -> f32 {
    let mean = |of: &[f32]| of.iter().sum::<f32>() / of.len() as f32;
    let (of_a, of_b) = (mean(a), mean(b));
    let sum = |of: &dyn Fn(f32, f32) -> f32| {
        a.iter()
            .zip(b)
            .map(|(a, b)| of(a - of_a, b - of_b))
            .sum::<f32>()
    };
    sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt().max(1e-9)
}

#[test]
fn what_is_said_is_heard_through_delay_and_loss() {
    let house = House::open();
    let (said, heard) = (house.path("said.wav"), house.path("heard.wav"));
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: link_voice::RATE,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let spoken = syllables();
    let mut wav = hound::WavWriter::create(&said, spec).expect("a file");
    for sample in &spoken {
        wav.write_sample(*sample).expect("a sample");
    }
    wav.finalize().expect("a file");

    let down = Impairment {
        delay: Duration::from_millis(40),
        loss: Loss::Independent(Probability::new(0.03).expect("a share")),
        ..Impairment::default()
    };
    let lab = house.lab(down, Impairment::default());
    let sender = house.sender(&["--voice", &said, "--seconds", "12"]);
    let receiver = house.receiver(
        &through(&lab, &sender.viewers),
        "viewer",
        &["--sound", &heard],
    );
    let sent = sender.program.report();
    let received = receiver.report();
    house.runtime.block_on(lab.stop());
    let voice = &received["call"]["voice"];
    println!("{voice:#}");
    let packets = count(&sent, "voice_sent");
    assert!(packets > 300, "{packets} packets were sent");
    assert!(count(voice, "received") * 10 > packets * 9, "{voice:#}");
    assert_eq!(count(voice, "refused"), 0, "{voice:#}");

    let mut wav = hound::WavReader::open(&heard).expect("what was heard");
    let samples: Vec<f32> = wav
        .samples::<i16>()
        .map(|sample| f32::from(sample.expect("a sample")) / 32_768.0)
        .collect();
    let (spoken, heard) = (loudness(&spoken), loudness(&samples));
    // The file is said twice at least; in the middle there is a whole one, from wherever it is.
    let middle: Vec<f32> = heard
        .iter()
        .skip(heard.len() / 3)
        .take(spoken.len())
        .copied()
        .collect();
    assert_eq!(
        middle.len(),
        spoken.len(),
        "{} windows were heard",
        heard.len()
    );
    let best = (0..spoken.len())
        .map(|turned| {
            let from: Vec<f32> = spoken
                .iter()
                .cycle()
                .skip(turned)
                .take(spoken.len())
                .copied()
                .collect();
            likeness(&from, &middle)
        })
        .fold(f32::MIN, f32::max);
    println!("{best} alike");
    assert!(best > 0.85, "{best} alike");
}

#[test]
fn what_is_no_voice_is_refused_in_one_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let package = crate::command::puppet(&folder);
    let package = crate::command::text(&package);
    let file = |name: &str| folder.path().join(name);
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 16_000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut wav = hound::WavWriter::create(file("slow.wav"), spec).expect("a file");
    wav.write_sample(1i16).expect("a sample");
    wav.finalize().expect("a file");
    let full = hound::WavSpec {
        sample_rate: 48_000,
        ..spec
    };
    let wav = hound::WavWriter::create(file("empty.wav"), full).expect("a file");
    wav.finalize().expect("a file");
    std::fs::write(file("text.wav"), "no sound").expect("a file");
    for (name, words) in [
        ("slow.wav", "16000 Hz"),
        ("empty.wav", "0 samples"),
        ("text.wav", "no voice"),
        ("nothing.wav", "no voice"),
    ] {
        let path = file(name);
        let path = crate::command::text(&path);
        crate::command::mon3tr(&["send", "--avatar", package, "--voice", path])
            .fails_naming(&[name, words]);
    }
}
