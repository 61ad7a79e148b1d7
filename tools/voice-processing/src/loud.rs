//! A voice that is too loud. The gain controller only makes low voices louder; a person close to a sensitive microphone is heard too loud.

use crate::PIECE;

/// Mean square of a voice that is loud enough: -20 dB of full scale.
const TARGET: f32 = 0.01;
/// Mean square of a piece that counts, so that pauses do not: -30 dB.
const HEARD: f32 = 0.001;
/// Share of a new piece in the mean: 1 s of voice.
const NEW: f32 = 0.01;

/// Turns a loud voice down, slowly, and back up only while it speaks lower.
#[derive(Debug)]
pub(crate) struct Attenuator {
    /// Mean square of the voice.
    power: f32,
    gain: f32,
}

impl Attenuator {
    pub(crate) fn new() -> Self {
        Self {
            power: TARGET,
            gain: 1.0,
        }
    }

    pub(crate) fn process(&mut self, piece: &mut [f32; PIECE]) {
        let power = piece.iter().map(|sample| sample * sample).sum::<f32>() / PIECE as f32;
        if power > HEARD {
            self.power += (power - self.power) * NEW;
        }
        let gain = (TARGET / self.power).sqrt().min(1.0);
        let step = (gain - self.gain) / PIECE as f32;
        for sample in piece {
            self.gain += step;
            *sample *= self.gain;
        }
    }
}
