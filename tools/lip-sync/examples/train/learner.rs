//! Learning: speech as rooms, microphones and telephones change it, and Adam (Kingma and Ba 2015) on the cross-entropy.

use crate::corpus::{Utterance, class_at};
use crate::windows;
use lip_sync::front_end::{BANDS, INPUTS, RATE};
use lip_sync::network::{HIDDEN, Network, OUTPUTS};

/// Windows of a step.
const BATCH: usize = 128;
/// The greatest step, at the beginning.
const STEP: f32 = 2e-3;
const DECAYS: [f32; 2] = [0.9, 0.999];
/// What a window of each class counts: closed lips are short, and seen at once where they are missed.
const COUNTS: [f32; OUTPUTS] = [1.0, 1.4, 1.5, 1.5, 1.6, 1.6, 1.3, 1.5, 0.42];
/// The inputs' common place and size: the first layer learns best from numbers around 0.
const MIDDLE: f32 = -3.0;
const SIZE: f32 = 2.5;

/// A network that learns.
pub(crate) struct Learner {
    random: fastrand::Rng,
    network: Network,
    moments: [Vec<f32>; 4],
    steps: i32,
}

impl Learner {
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed);
        let mut layer = |rows: usize, inputs: usize| -> Vec<f32> {
            let size = (6.0 / inputs as f32).sqrt();
            let row = rows * (inputs + 1);
            (0..row)
                .map(|_| size * (2.0 * random.f32() - 1.0))
                .collect()
        };
        let network = Network {
            hidden: layer(HIDDEN, INPUTS),
            outputs: layer(OUTPUTS, HIDDEN),
        };
        let zeros = |of: &[f32]| vec![0.0; of.len()];
        let moments = [
            zeros(&network.hidden),
            zeros(&network.hidden),
            zeros(&network.outputs),
            zeros(&network.outputs),
        ];
        Self {
            random,
            network,
            moments,
            steps: 0,
        }
    }

    /// The network for inputs as they are.
    pub(crate) fn network(&self) -> Network {
        let mut network = self.network.clone();
        for row in network.hidden.chunks_exact_mut(INPUTS + 1) {
            let mut sum = 0.0;
            for weight in &mut row[..INPUTS] {
                *weight /= SIZE;
                sum += *weight;
            }
            row[INPUTS] -= MIDDLE * sum;
        }
        network
    }

    /// One round over the corpus; the mean loss.
    pub(crate) fn learn(&mut self, corpus: &[Utterance], round: u32, rounds: u32) -> f32 {
        // All windows of the round are heard first and then learnt in another order. Half bytes would do; it is 400 MB.
        let (mut seen, mut classes) = (Vec::new(), Vec::new());
        for utterance in corpus {
            let shrink = 0.82 + 0.38 * self.random.f32();
            let (mut sound, marks) = utterance.at_16_khz(shrink);
            disturb(&mut sound, &mut self.random);
            windows(&sound, |inputs, middle| {
                seen.extend_from_slice(inputs);
                classes.push(class_at(&marks, middle));
            });
        }
        let mut order: Vec<usize> = (0..classes.len()).collect();
        self.random.shuffle(&mut order);
        let (mut loss, batches) = (0.0, order.len() / BATCH);
        for (k, batch) in order.chunks_exact(BATCH).enumerate() {
            let done = (round as f32 + k as f32 / batches as f32) / rounds as f32;
            let step = STEP * (0.5 + 0.5 * (std::f32::consts::PI * done).cos()) + 1e-5;
            loss += self.step(batch, &seen, &classes, step);
        }
        loss / batches as f32
    }

    fn step(&mut self, batch: &[usize], seen: &[f32], classes: &[usize], step: f32) -> f32 {
        let mut slopes = [
            vec![0.0f32; self.network.hidden.len()],
            vec![0.0f32; self.network.outputs.len()],
        ];
        let (mut loss, mut total) = (0.0, 0.0);
        let mut neurons = [0.0; HIDDEN];
        let mut inputs = [0.0; INPUTS];
        for at in batch {
            let raw = &seen[at * INPUTS..(at + 1) * INPUTS];
            for (input, raw) in inputs.iter_mut().zip(raw) {
                *input = (raw - MIDDLE) / SIZE;
            }
            let outputs = self.network.judge(&inputs, &mut neurons);
            let class = classes[*at];
            let counts = COUNTS[class];
            loss -= counts * outputs[class].max(1e-9).ln();
            total += counts;
            let mut back = [0.0f32; HIDDEN];
            for (k, output) in outputs.into_iter().enumerate() {
                let slope = counts * (output - f32::from(u8::from(k == class)));
                let row = k * (HIDDEN + 1)..(k + 1) * (HIDDEN + 1);
                let (row, weights) = (&mut slopes[1][row.clone()], &self.network.outputs[row]);
                for j in 0..HIDDEN {
                    row[j] += slope * neurons[j];
                    back[j] += slope * weights[j];
                }
                row[HIDDEN] += slope;
            }
            for (j, row) in slopes[0].chunks_exact_mut(INPUTS + 1).enumerate() {
                if neurons[j] > 0.0 {
                    let (row, bias) = row.split_at_mut(INPUTS);
                    for (slope, input) in row.iter_mut().zip(&inputs) {
                        *slope += back[j] * input;
                    }
                    bias[0] += back[j];
                }
            }
        }
        self.steps += 1;
        let [m, v] = DECAYS.map(|decay| 1.0 - decay.powi(self.steps));
        let layers = [&mut self.network.hidden, &mut self.network.outputs];
        for ((layer, slopes), moments) in layers
            .into_iter()
            .zip(slopes)
            .zip(self.moments.chunks_exact_mut(2))
        {
            let (first, second) = moments.split_at_mut(1);
            let moments = first[0].iter_mut().zip(&mut second[0]);
            for ((weight, slope), (first, second)) in layer.iter_mut().zip(slopes).zip(moments) {
                let slope = slope / BATCH as f32;
                *first += (1.0 - DECAYS[0]) * (slope - *first);
                *second += (1.0 - DECAYS[1]) * (slope * slope - *second);
                *weight -= step * (*first / m / ((*second / v).sqrt() + 1e-8) + 1e-3 * *weight);
            }
        }
        loss / total
    }
}

const _: () = assert!(INPUTS.is_multiple_of(BANDS), "whole windows");

/// Speech as it comes through a room, a microphone or a telephone; a quarter of it stays as it is but for its loudness.
fn disturb(sound: &mut [f32], random: &mut fastrand::Rng) {
    let change = random.f32() > 0.25;
    if change && random.f32() < 0.4 {
        echo(sound, random);
    }
    if change && random.f32() < 0.25 {
        // A telephone: 300 to 3400 Hz.
        high_pass(sound, 300.0);
        low_pass(sound, 3400.0);
        low_pass(sound, 3600.0);
    } else if change && random.f32() < 0.5 {
        // A microphone that is dull or thin.
        let mut low = sound.to_vec();
        low_pass(&mut low, 1000.0);
        let tilt = 1.2 * (random.f32() - 0.5);
        for (sample, low) in sound.iter_mut().zip(low) {
            *sample += tilt * (low - (*sample - low));
        }
    }
    let power = sound.iter().map(|s| s * s).sum::<f32>() / sound.len().max(1) as f32;
    let gain = 10f32.powf((random.f32() * 32.0 - 26.0) / 20.0);
    let noise = if change {
        10f32.powf(-(8.0 + 32.0 * random.f32()) / 20.0)
    } else {
        1e-4
    };
    let (size, brown) = (noise * power.sqrt(), random.f32() * 0.95);
    let mut last = 0.0;
    for sample in sound {
        let white = (random.f32() + random.f32() + random.f32() - 1.5) * 2.0;
        last = brown * last + (1.0 - brown * brown).sqrt() * white;
        *sample = (gain * (*sample + size * last)).clamp(-1.0, 1.0);
    }
}

/// A room: 24 reflections within 250 ms that decay.
fn echo(sound: &mut [f32], random: &mut fastrand::Rng) {
    let (dry, decay) = (sound.to_vec(), 0.03 + 0.07 * random.f32());
    for _ in 0..24 {
        let seconds = 0.002 + 0.25 * random.f32() * random.f32();
        let gain = 0.6 * (-seconds / decay).exp() * (2.0 * random.f32() - 1.0);
        let delay = (seconds * RATE as f32) as usize;
        for (sample, dry) in sound.iter_mut().skip(delay).zip(&dry) {
            *sample += gain * dry;
        }
    }
}

fn low_pass(sound: &mut [f32], hz: f32) {
    let share = 1.0 - (-std::f32::consts::TAU * hz / RATE as f32).exp();
    for _ in 0..2 {
        let mut held = 0.0;
        for sample in &mut *sound {
            held += share * (*sample - held);
            *sample = held;
        }
    }
}

fn high_pass(sound: &mut [f32], hz: f32) {
    let share = 1.0 - (-std::f32::consts::TAU * hz / RATE as f32).exp();
    for _ in 0..2 {
        let mut held = 0.0;
        for sample in &mut *sound {
            held += share * (*sample - held);
            *sample -= held;
        }
    }
}
