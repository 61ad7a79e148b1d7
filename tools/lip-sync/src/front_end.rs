//! From sound to what the network sees: decimation to 16 kHz, the energies of 26 mel bands each 10 ms, relative to how loud the
//! voice has been, and the windows around one moment.

use std::f32::consts::TAU;

/// Samples a second that the bands are made of.
pub const RATE: u32 = 16_000;
/// Mel bands from 60 to 7600 Hz.
pub const BANDS: usize = 26;
/// Samples of a window, 25 ms, and from one window to the next, 10 ms.
pub const WINDOW: usize = 400;
/// Samples from one window to the next.
pub const STEP: usize = 160;
/// The windows that the network sees, relative to the one that it judges.
pub const OFFSETS: [i32; 10] = [-10, -7, -5, -3, -2, -1, 0, 1, 2, 3];
/// Windows that are waited for.
pub const AHEAD: usize = 3;
/// Windows that are kept: from the earliest to the latest of [`OFFSETS`].
const KEPT: usize = 14;
/// Numbers that the network sees: the windows' bands, and what they are as a rule in this voice.
pub const INPUTS: usize = BANDS * (OFFSETS.len() + 1);
/// Points of the Fourier transform.
const POINTS: usize = 512;
/// The lowest and the highest band's outer ends, Hz.
const BAND_HZ: [f32; 2] = [60.0, 7600.0];
/// The least level (natural logarithm of a window's mean band energy): below it nothing is voice.
const LEAST_LEVEL: f32 = -9.0;
/// How fast the level falls while no one speaks, per window: by 1 (4.3 dB) in four seconds.
const FALL: f32 = 0.0025;
/// Share by which the level rises to a louder window: within 50 ms.
const RISE: f32 = 0.2;
/// Windows this loud (relative to the level) tell of the voice, its microphone and its room.
const TELLING: f32 = -2.5;
/// What the bands of a voice are before anything was heard, how many windows that counts, and the share of each window after many: they follow
/// in a second of speech.
const USUAL: f32 = -2.5;
const USUAL_COUNTS: f32 = 25.0;
const USUAL_SHARE: f32 = 0.008;
/// Taps of the decimator's low-pass filter, a multiple of three and one more so that it is symmetric.
const TAPS: usize = 61;
/// Its cut-off, Hz: the rejection is full at 8.8 kHz, which folds onto 7.2 kHz.
const CUT_OFF: f32 = 7300.0;

/// 48 kHz to 16 kHz through a windowed sinc (Blackman), 0.6 ms late.
#[derive(Debug)]
pub struct Decimator {
    taps: [f32; TAPS],
    past: [f32; TAPS],
    at: usize,
    phase: usize,
}

impl Default for Decimator {
    fn default() -> Self {
        let middle = (TAPS / 2) as f32;
        let mut taps: [f32; TAPS] = std::array::from_fn(|k| {
            let x = k as f32 - middle;
            let turn = TAU * CUT_OFF / 48_000.0 * x;
            let sinc = if x == 0.0 { 1.0 } else { turn.sin() / turn };
            let place = TAU * k as f32 / (TAPS - 1) as f32;
            sinc * (0.42 - 0.5 * place.cos() + 0.08 * (2.0 * place).cos())
        });
        let sum: f32 = taps.iter().sum();
        taps.iter_mut().for_each(|tap| *tap /= sum);
        Self {
            taps,
            past: [0.0; TAPS],
            at: 0,
            phase: 0,
        }
    }
}

impl Decimator {
    /// Takes one sample of 48 kHz; of each third comes one of 16 kHz. What is no number counts as silence.
    pub fn push(&mut self, sample: f32) -> Option<f32> {
        self.past[self.at] = if sample.is_finite() {
            sample.clamp(-1.0, 1.0)
        } else {
            0.0
        };
        self.at = (self.at + 1) % TAPS;
        self.phase = (self.phase + 1) % 3;
        if self.phase != 0 {
            return None;
        }
        let (late, early) = self.past.split_at(self.at);
        let past = early.iter().chain(late);
        Some(self.taps.iter().zip(past).map(|(tap, s)| tap * s).sum())
    }
}

/// What one window showed.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    /// Logarithms of the bands' energies relative to the voice's level, from -9 to 3.
    pub bands: [f32; BANDS],
    /// Loudness relative to the level of the voice so far, natural logarithm of energy.
    pub loudness: f32,
}

const NO_WINDOW: Window = Window {
    bands: [-9.0; BANDS],
    loudness: -9.0,
};

/// Windows of a 16 kHz sound, and those around one moment.
#[derive(Debug)]
pub struct FrontEnd {
    samples: [f32; WINDOW],
    filled: usize,
    hann: Vec<f32>,
    turns: Vec<[f32; 2]>,
    /// The bands' triangles over the spectrum: band, bin and weight.
    triangles: Vec<(usize, usize, f32)>,
    level: f32,
    /// The mean of the bands of telling windows, and how many there were.
    usual: [f32; BANDS],
    told: f32,
    kept: [Window; KEPT],
    newest: usize,
}

impl Default for FrontEnd {
    fn default() -> Self {
        let hann = (0..WINDOW).map(|k| 0.5 - 0.5 * (TAU * (k as f32 + 0.5) / WINDOW as f32).cos());
        let turns = (0..POINTS / 2).map(|k| {
            let turn = -TAU * k as f32 / POINTS as f32;
            [turn.cos(), turn.sin()]
        });
        Self {
            samples: [0.0; WINDOW],
            filled: WINDOW - STEP,
            hann: hann.collect(),
            turns: turns.collect(),
            triangles: triangles(),
            level: LEAST_LEVEL,
            usual: [USUAL; BANDS],
            told: USUAL_COUNTS,
            kept: [NO_WINDOW; KEPT],
            newest: 0,
        }
    }
}

/// Triangles that are equally wide on the mel scale (O'Shaughnessy 1987), each with the area 1.
fn triangles() -> Vec<(usize, usize, f32)> {
    let mel = |hz: f32| 2595.0 * (1.0 + hz / 700.0).log10();
    let hz = |mel: f32| 700.0 * (10.0f32.powf(mel / 2595.0) - 1.0);
    let [low, high] = BAND_HZ.map(mel);
    let edge = |k: usize| hz(low + (high - low) * k as f32 / (BANDS + 1) as f32);
    let mut all = Vec::new();
    for band in 0..BANDS {
        let (from, top, to) = (edge(band), edge(band + 1), edge(band + 2));
        let begin = all.len();
        for bin in 0..POINTS / 2 {
            let at = bin as f32 * RATE as f32 / POINTS as f32;
            let weight = ((at - from) / (top - from)).min((to - at) / (to - top));
            if weight > 0.0 {
                all.push((band, bin, weight));
            }
        }
        let sum: f32 = all[begin..].iter().map(|(_, _, weight)| weight).sum();
        for (_, _, weight) in &mut all[begin..] {
            *weight /= sum.max(f32::MIN_POSITIVE);
        }
    }
    all
}

impl FrontEnd {
    /// Takes one sample of 16 kHz; each 160th completes a window, and true is returned.
    pub fn push(&mut self, sample: f32) -> bool {
        self.samples[self.filled] = sample;
        self.filled += 1;
        if self.filled < WINDOW {
            return false;
        }
        self.look();
        self.samples.copy_within(STEP.., 0);
        self.filled = WINDOW - STEP;
        true
    }

    fn look(&mut self) {
        let mut points = [[0.0f32; 2]; POINTS];
        for ((point, sample), hann) in points.iter_mut().zip(self.samples).zip(&self.hann) {
            point[0] = sample * hann;
        }
        transform(&mut points, &self.turns);
        let mut energies = [0.0f32; BANDS];
        for (band, bin, weight) in &self.triangles {
            let [re, im] = points[*bin];
            energies[*band] += weight * (re * re + im * im);
        }
        let mean = energies.iter().sum::<f32>() / BANDS as f32;
        let loud = (mean + 1e-9).ln();
        if loud > self.level {
            self.level += RISE * (loud - self.level);
        } else {
            self.level = (self.level - FALL).max(LEAST_LEVEL);
        }
        let floor = (self.level - 9.0).exp();
        self.newest = (self.newest + 1) % KEPT;
        self.kept[self.newest] = Window {
            bands: energies.map(|energy| ((energy + floor).ln() - self.level).clamp(-9.0, 3.0)),
            loudness: (loud - self.level).max(-9.0),
        };
        let Window { bands, loudness } = self.kept[self.newest];
        if loudness > TELLING {
            self.told += 1.0;
            let share = (1.0 / self.told).max(USUAL_SHARE);
            for (usual, band) in self.usual.iter_mut().zip(bands) {
                *usual += share * (band - *usual);
            }
        }
    }

    /// The window `AHEAD` before the newest: the one that is judged.
    #[must_use]
    pub fn judged(&self) -> &Window {
        &self.kept[(self.newest + KEPT - AHEAD) % KEPT]
    }

    /// What the network sees of the moment of [`Self::judged`].
    pub fn context(&self, out: &mut [f32; INPUTS]) {
        let (windows, usual) = out.split_at_mut(BANDS * OFFSETS.len());
        usual.copy_from_slice(&self.usual);
        for (offset, out) in OFFSETS.into_iter().zip(windows.chunks_exact_mut(BANDS)) {
            let back = AHEAD.saturating_add_signed(-offset as isize) % KEPT;
            let at = (self.newest + KEPT - back) % KEPT;
            out.copy_from_slice(&self.kept[at].bands);
        }
    }
}

/// The discrete Fourier transform in place, radix 2 (Cooley and Tukey 1965).
fn transform(points: &mut [[f32; 2]; POINTS], turns: &[[f32; 2]]) {
    let bits = POINTS.trailing_zeros();
    for k in 0..POINTS {
        let other = k.reverse_bits() >> (usize::BITS - bits);
        if other > k {
            points.swap(k, other);
        }
    }
    let mut half = 1;
    while half < POINTS {
        let stride = POINTS / (2 * half);
        for block in points.chunks_exact_mut(2 * half) {
            let (even, odd) = block.split_at_mut(half);
            for ((e, o), [c, s]) in even.iter_mut().zip(odd).zip(turns.iter().step_by(stride)) {
                let turned = [o[0] * c - o[1] * s, o[0] * s + o[1] * c];
                *o = [e[0] - turned[0], e[1] - turned[1]];
                *e = [e[0] + turned[0], e[1] + turned[1]];
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `hz` at 48 kHz for 0.1 s, and what is left of it, as root mean square.
    fn decimated(hz: f32) -> f32 {
        let mut decimator = Decimator::default();
        let out: Vec<f32> = (0..4800)
            .filter_map(|k| decimator.push((TAU * hz * k as f32 / 48_000.0).sin()))
            .collect();
        assert_eq!(out.len(), 1600, "each third");
        (out[100..].iter().map(|s| s * s).sum::<f32>() / 1500.0).sqrt()
    }

    #[test]
    fn what_16_khz_cannot_hold_does_not_fold_back_and_speech_passes() {
        for hz in [100.0, 1000.0, 5000.0] {
            assert!(
                (decimated(hz) - 0.5f32.sqrt()).abs() < 0.02,
                "{hz} Hz passes"
            );
        }
        for hz in [9500.0, 12_000.0, 20_000.0] {
            assert!(decimated(hz) < 0.005, "{hz} Hz is left: {}", decimated(hz));
        }
    }

    #[test]
    fn the_transform_is_the_sum_that_defines_it() {
        let mut points = [[0.0f32; 2]; POINTS];
        let mut random = fastrand::Rng::with_seed(1);
        points.iter_mut().for_each(|p| p[0] = random.f32() - 0.5);
        let given = points;
        transform(&mut points, &FrontEnd::default().turns);
        for bin in [0, 1, 7, 100, 255] {
            let mut sum = [0.0f64; 2];
            for (k, [value, _]) in given.iter().enumerate() {
                let turn = std::f64::consts::TAU * (bin * k % POINTS) as f64 / POINTS as f64;
                sum[0] += f64::from(*value) * turn.cos();
                sum[1] -= f64::from(*value) * turn.sin();
            }
            for (is, should) in points[bin].into_iter().zip(sum) {
                assert!(
                    (f64::from(is) - should).abs() < 1e-4,
                    "bin {bin}: {is} {should}"
                );
            }
        }
    }

    #[test]
    fn a_voice_ten_times_as_loud_looks_the_same_after_a_while() {
        let bands = |gain: f32| {
            let mut front = FrontEnd::default();
            for k in 0..RATE {
                let t = k as f32 / RATE as f32;
                front.push(gain * ((TAU * 300.0 * t).sin() + 0.3 * (TAU * 2000.0 * t).sin()));
            }
            front.judged().bands
        };
        for (quiet, loud) in bands(0.05).into_iter().zip(bands(0.5)) {
            assert!((quiet - loud).abs() < 0.1, "{quiet} and {loud}");
        }
    }
}
