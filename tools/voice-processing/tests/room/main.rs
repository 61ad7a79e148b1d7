//! A person in a room whose loudspeaker plays the other one: what is sent of it. The room, the voices and the devices are made here, in f64.

#![allow(
    clippy::cast_possible_truncation,
    reason = "sizes, and samples of f64 that are handed over as f32"
)]

mod acoustics;
mod echo;
mod level;
mod speech;

use acoustics::{RATE, convolve, delayed, impulse_response, sampled};
use speech::Random;
use std::time::{Duration, Instant};
use voice_processing::{DELAY, FRAME, FarEnd, PIECE, VoiceProcessor};

/// Of a loudspeaker whose echo is 7 dB lower than what is played.
pub(crate) const MODERATE: f64 = 0.25;

/// A loudspeaker and a microphone in a room.
pub(crate) struct Devices {
    /// What the loudspeaker makes of full scale, at 1 m.
    pub(crate) loudness: f64,
    /// What they do not know of their delay, samples.
    pub(crate) hidden: usize,
    /// How much slower the microphone's clock runs than the loudspeaker's.
    pub(crate) slower: f64,
}

impl Devices {
    /// The echo of what is played, as the microphone hears it.
    pub(crate) fn echo(&self, far: &[f64]) -> Vec<f64> {
        // On a table, 60 cm apart.
        let mut response = impulse_response([1.0, 1.2, 0.8], [1.5, 1.5, 0.9]);
        for value in &mut response {
            *value *= self.loudness;
        }
        sampled(
            &delayed(&convolve(far, &response), self.hidden),
            self.slower,
        )
    }

    /// What is sent of what the microphone hears, while the loudspeaker plays `far`.
    pub(crate) fn sent(&self, far: &[f64], heard: &[f64]) -> Vec<f64> {
        let far_end = FarEnd::default();
        let mut processor = VoiceProcessor::new(Some(&far_end));
        let zero = Instant::now() + Duration::from_secs(1);
        let mut random = Random::new(9);
        // Devices tell their times to within 0.5 ms.
        let mut at = move |sample: usize, apart: f64| {
            zero + Duration::from_secs_f64(sample as f64 / RATE * apart)
                + Duration::from_secs_f64(0.25e-3 * (random.next() + 1.0))
        };
        let mut played = 0;
        let mut sent = Vec::with_capacity(heard.len());
        for (number, frame) in heard.as_chunks::<FRAME>().0.iter().enumerate() {
            // A loudspeaker is given its pieces 40 ms before they are heard.
            while played < (number + 1) * FRAME + 1920 && played + PIECE <= far.len() {
                let piece = std::array::from_fn(|k| far[played + k] as f32);
                far_end.play(at(played, 1.0), &piece);
                played += PIECE;
            }
            let mut frame = frame.map(|sample| sample.clamp(-1.0, 1.0) as f32);
            processor.process(at(number * FRAME, 1.0 + self.slower), &mut frame);
            sent.extend(frame.map(f64::from));
        }
        on_time(&sent)
    }
}

/// What is sent where there is no loudspeaker.
pub(crate) fn sent_alone(heard: &[f64]) -> Vec<f64> {
    let mut processor = VoiceProcessor::new(None);
    let zero = Instant::now();
    let mut sent = Vec::with_capacity(heard.len());
    for frame in heard.as_chunks::<FRAME>().0 {
        let mut frame = frame.map(|sample| sample.clamp(-1.0, 1.0) as f32);
        processor.process(zero, &mut frame);
        sent.extend(frame.map(f64::from));
    }
    on_time(&sent)
}

/// Without the processing's own delay.
fn on_time(sent: &[f64]) -> Vec<f64> {
    sent[(DELAY.as_secs_f64() * RATE) as usize..].to_vec()
}

/// The part of a signal from one second to another.
pub(crate) fn part(signal: &[f64], from: f64, to: f64) -> &[f64] {
    let end = ((to * RATE) as usize).min(signal.len());
    &signal[(from * RATE) as usize..end]
}

pub(crate) fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}
