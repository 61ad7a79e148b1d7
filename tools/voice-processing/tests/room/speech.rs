//! A speech-like signal by formant synthesis (Klatt, "Software for a cascade/parallel formant synthesizer", 1980), and levels of signals.

use crate::acoustics::RATE;
use std::f64::consts::PI;

/// Formants of vowels, Hz: of ah, ee, oo, eh, aw.
const VOWELS: [[f64; 3]; 5] = [
    [730.0, 1090.0, 2440.0],
    [270.0, 2290.0, 3010.0],
    [300.0, 870.0, 2240.0],
    [530.0, 1840.0, 2480.0],
    [570.0, 840.0, 2410.0],
];
const BANDWIDTHS: [f64; 3] = [80.0, 100.0, 140.0];

/// Evenly distributed from -1 to 1, the same on every machine.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(2) + 1)
    }

    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1u32 << 30) - 1.0
    }
}

/// White noise of a level.
pub(crate) fn noise(seconds: f64, dbfs: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    let noise: Vec<f64> = (0..(seconds * RATE) as usize)
        .map(|_| random.next())
        .collect();
    at_level(&noise, dbfs)
}

/// Words of a person whose voice is of about `pitch` Hz, with pauses, at a level while they speak.
pub(crate) fn speech(seconds: f64, pitch: f64, dbfs: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    let count = (seconds * RATE) as usize;
    let mut out = Vec::with_capacity(count);
    let mut phase = 0.0;
    let mut formants = VOWELS[0];
    let mut states = [[0.0f64; 2]; 3];
    let mut vowel = 0;
    while out.len() < count {
        let syllables = 2 + ((random.next() + 1.0) * 2.5) as usize;
        for syllable in 0..syllables {
            vowel = (vowel + 1 + ((random.next() + 1.0) * 2.0) as usize) % VOWELS.len();
            let target = VOWELS[vowel];
            let length = (RATE * (0.16 + 0.06 * random.next())) as usize;
            // A fricative before some of them.
            if random.next() > 0.2 {
                let length = (RATE * 0.06) as usize;
                let mut before = 0.0;
                for k in 0..length {
                    let white = random.next();
                    let envelope = (PI * k as f64 / length as f64).sin();
                    out.push(0.15 * envelope * (white - before));
                    before = white;
                }
            }
            let tone = pitch * (1.1 - 0.06 * syllable as f64 + 0.08 * random.next());
            for k in 0..length {
                let within = k as f64 / length as f64;
                let hz = tone * (1.0 + 0.1 * (PI * within).sin() + 0.01 * random.next());
                phase += hz / RATE;
                // A glottal pulse: the flow's derivative, strongest at closure.
                phase = phase.fract();
                let open = phase / 0.6;
                let source = if open < 1.0 {
                    open * (2.0 - 3.0 * open)
                } else {
                    0.0
                };
                let mut voice = source + 0.01 * random.next();
                for ((state, formant), (target, width)) in
                    (states.iter_mut().zip(&mut formants)).zip(target.iter().zip(BANDWIDTHS))
                {
                    *formant += (target - *formant) / (0.02 * RATE);
                    let radius = (-PI * width / RATE).exp();
                    let (b, c) = (
                        2.0 * radius * (2.0 * PI * *formant / RATE).cos(),
                        -radius * radius,
                    );
                    let next = (1.0 - b - c) * voice + b * state[0] + c * state[1];
                    *state = [next, state[0]];
                    voice = next;
                }
                let envelope = (within / 0.15).min((1.0 - within) / 0.25).clamp(0.0, 1.0);
                out.push(envelope * voice);
            }
        }
        let pause = (RATE * (0.25 + 0.15 * random.next())) as usize;
        out.extend(std::iter::repeat_n(0.0, pause));
    }
    out.truncate(count);
    at_level(&out, dbfs)
}

fn at_level(signal: &[f64], dbfs: f64) -> Vec<f64> {
    let gain = 10f64.powf((dbfs - active_level(signal)) / 20.0);
    signal.iter().map(|sample| sample * gain).collect()
}

/// Mean square, in dB of full scale.
pub(crate) fn level(signal: &[f64]) -> f64 {
    let power = signal.iter().map(|sample| sample * sample).sum::<f64>() / signal.len() as f64;
    10.0 * power.max(1e-20).log10()
}

/// The level without pauses: of the windows of 20 ms that are within 20 dB of the loudest tenth.
pub(crate) fn active_level(signal: &[f64]) -> f64 {
    let mut levels: Vec<f64> = signal.chunks_exact(960).map(level).collect();
    levels.sort_by(f64::total_cmp);
    let loud = levels[levels.len() * 9 / 10] - 20.0;
    let powers: Vec<f64> = (levels.iter().filter(|level| **level > loud))
        .map(|level| 10f64.powf(level / 10.0))
        .collect();
    10.0 * (powers.iter().sum::<f64>() / powers.len() as f64).log10()
}

/// How alike the loudness of two signals runs, in windows of 20 ms, from -1 to 1.
pub(crate) fn likeness(a: &[f64], b: &[f64]) -> f64 {
    let loudness = |of: &[f64]| -> Vec<f64> {
        of.chunks_exact(960)
            .map(|window| 10f64.powf(level(window) / 20.0))
            .collect()
    };
    let (a, b) = (loudness(a), loudness(b));
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    let (of_a, of_b) = (mean(&a), mean(&b));
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        a.iter().zip(&b).map(|(a, b)| of(a - of_a, b - of_b)).sum()
    };
    sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt()
}
