//! Speech that a computer can tell apart, and how alike what was heard is to what was said.

/// Samples a second of voice.
pub const RATE: usize = 48_000;
/// Samples of a loudness: 20 ms.
pub const WINDOW: usize = RATE / 50;
/// From one loudness to the next, samples.
pub const STEP: usize = WINDOW / 4;
/// Loudnesses that are compared at a time: 2.5 s.
pub const PIECE: usize = RATE * 5 / 2 / STEP;
/// Of what is said again and again, seconds.
const SPOKEN: usize = 5;

/// Syllables of 150 ms at 120 Hz, of which a fixed half is loud, another one for each person: no part of them looks like another.
#[must_use]
pub fn syllables(person: u32) -> Vec<f32> {
    let mut random = person;
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

/// The same syllables sung at one pitch, Hz, by which a voice is told from others that are heard at the same time.
#[must_use]
pub fn sung(person: u32, pitch: f32) -> Vec<f32> {
    let spoken = loudness(&syllables(person));
    let tone = (0..SPOKEN * RATE).map(|k| {
        let turns = (k as f32 / RATE as f32 * pitch).fract();
        (turns * std::f32::consts::TAU).sin()
    });
    let strength = |k: usize| *spoken.get(k / STEP).unwrap_or(&0.0);
    tone.enumerate()
        .map(|(k, tone)| 2.0 * strength(k) * tone)
        .collect()
}

/// As [`loudness`], of one pitch.
#[must_use]
pub fn loudness_at(samples: &[f32], pitch: f32) -> Vec<f32> {
    (samples.windows(WINDOW).step_by(STEP))
        .map(|window| {
            let (mut real, mut imaginary) = (0.0, 0.0);
            for (k, sample) in window.iter().enumerate() {
                let angle = (k as f32 / RATE as f32 * pitch).fract() * std::f32::consts::TAU;
                real += sample * angle.cos();
                imaginary += sample * angle.sin();
            }
            real.hypot(imaginary) / WINDOW as f32
        })
        .collect()
}

/// Syllables of a voice whose pitch, formants and pauses vary: what a gain controller takes for speech.
#[must_use]
pub fn talk() -> Vec<f32> {
    let (mut random, mut phase, mut states) = (7u32, 0.0f32, [[0.0f32; 2]; 2]);
    let mut next = move || {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (random >> 8) as f32 / (1u32 << 24) as f32
    };
    let mut out = Vec::new();
    while out.len() < SPOKEN * RATE {
        let (pitch, low, high) = (
            100.0 + 60.0 * next(),
            300.0 + 500.0 * next(),
            900.0 + 1400.0 * next(),
        );
        let (length, loud) = (RATE / 6, if next() < 0.25 { 0.0 } else { 1.0 });
        for k in 0..length {
            let envelope = (k as f32 / length as f32 * std::f32::consts::PI).sin();
            phase = (phase + pitch / RATE as f32).fract();
            let mut sample = if phase < 0.6 { phase } else { 0.0 } - 0.18 + 0.02 * next();
            for (state, hz) in states.iter_mut().zip([low, high]) {
                let (radius, angle) = (0.99, std::f32::consts::TAU * hz / RATE as f32);
                let (b, c) = (2.0 * radius * angle.cos(), -radius * radius);
                sample = (1.0 - b - c) * sample + b * state[0] + c * state[1];
                *state = [sample, state[0]];
            }
            out.push(loud * envelope * sample);
        }
    }
    out.truncate(SPOKEN * RATE);
    let power = out.iter().map(|sample| sample * sample).sum::<f32>() / out.len() as f32;
    let scale = 0.1 / power.sqrt();
    for sample in &mut out {
        *sample = (*sample * scale).clamp(-0.9, 0.9);
    }
    out
}

/// How loud samples are, in windows of 20 ms, 5 ms from one to the next.
#[must_use]
pub fn loudness(samples: &[f32]) -> Vec<f32> {
    (samples.windows(WINDOW).step_by(STEP))
        .map(|window| (window.iter().map(|s| s * s).sum::<f32>() / WINDOW as f32).sqrt())
        .collect()
}

/// Correlation of a piece with the part of what is said again and again that it is most like.
#[must_use]
pub fn best_likeness(said: &[f32], piece: &[f32]) -> f32 {
    let twice = [said, said].concat();
    (twice.windows(piece.len()))
        .map(|part| likeness(part, piece))
        .fold(f32::MIN, f32::max)
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
