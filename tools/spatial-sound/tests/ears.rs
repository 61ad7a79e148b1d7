//! What both ears hear, against Woodworth's formula of the delay and the filter of the sphere's shadow in the frequency domain.

use glam::Vec3;
use spatial_sound::{Binaural, HEAD_RADIUS, RATE, REFERENCE_DISTANCE, SPEED_OF_SOUND};

const PIECE: usize = 480;

/// Both ears, of a voice whose places are given piece by piece.
fn heard(voice: &[f32], place: impl Fn(usize) -> Option<Vec3>) -> Vec<[f32; 2]> {
    let mut binaural = Binaural::default();
    let mut out = vec![[0.0; 2]; voice.len()];
    for (k, (voice, out)) in voice.chunks(PIECE).zip(out.chunks_mut(PIECE)).enumerate() {
        binaural.add(voice, place(k), out);
    }
    out
}

fn noise(count: usize) -> Vec<f32> {
    let mut random = 1u32;
    (0..count)
        .map(|_| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 8) as f32 / (1 << 23) as f32 - 1.0
        })
        .collect()
}

#[allow(clippy::cast_possible_truncation, reason = "samples are singles")]
fn tone(hertz: f64, count: usize) -> Vec<f32> {
    (0..count)
        .map(|k| (k as f64 * hertz / f64::from(RATE) * std::f64::consts::TAU).sin() as f32 * 0.5)
        .collect()
}

/// At this angle from ahead to the right, radians, on the level of the ears.
fn beside(azimuth: f64) -> Vec3 {
    #[allow(clippy::cast_possible_truncation, reason = "places are singles")]
    let azimuth = azimuth as f32;
    Vec3::new(azimuth.sin(), 0.0, -azimuth.cos()) * REFERENCE_DISTANCE
}

fn ear(heard: &[[f32; 2]], ear: usize) -> Vec<f64> {
    heard
        .iter()
        .skip(PIECE)
        .map(|both| f64::from(both[ear]))
        .collect()
}

fn power(samples: &[f64]) -> f64 {
    samples.iter().map(|s| s * s).sum::<f64>() / samples.len() as f64
}

/// By how many samples the left ear hears later: the maximum of the correlation of both, between samples by a parabola.
fn later(heard: &[[f32; 2]]) -> f64 {
    let (left, right) = (ear(heard, 0), ear(heard, 1));
    let correlation = |lag: i32| -> f64 {
        (100..left.len() - 100)
            .map(|k| left[k] * right[usize::try_from(k as i64 - i64::from(lag)).expect("within")])
            .sum()
    };
    let best = (-50..=50)
        .max_by(|a, b| correlation(*a).total_cmp(&correlation(*b)))
        .expect("lags");
    let [a, b, c] = [best - 1, best, best + 1].map(correlation);
    f64::from(best) + (a - c) / (2.0 * (a - 2.0 * b + c))
}

#[test]
fn the_far_ear_hears_later_by_woodworths_formula() {
    let voice = noise(20 * PIECE);
    for degrees in [-90.0f64, -60.0, -30.0, 0.0, 15.0, 45.0, 75.0, 90.0] {
        let azimuth = degrees.to_radians();
        let both = heard(&voice, |_| Some(beside(azimuth)));
        let expected = f64::from(HEAD_RADIUS) / f64::from(SPEED_OF_SOUND)
            * (azimuth + azimuth.sin())
            * f64::from(RATE);
        let got = later(&both);
        // The shadow's filter delays what it lets through, too: by less than 0.1 ms.
        assert!(
            (got - expected).abs() < 4.8,
            "{degrees}: {got:.2} samples, not {expected:.2}"
        );
    }
}

#[test]
fn the_shadow_is_that_of_a_sphere_at_every_pitch() {
    for hertz in [200.0f64, 1_000.0, 4_000.0] {
        let voice = tone(hertz, 20 * PIECE);
        for degrees in [0.0f64, 40.0, 90.0, 140.0] {
            let both = heard(&voice, |_| Some(beside(degrees.to_radians())));
            for (number, from_ear) in [(0, 90.0 + degrees), (1, (90.0 - degrees).abs())] {
                let high = 1.05
                    + 0.95
                        * (from_ear.min(360.0 - from_ear) / 150.0 * 180.0)
                            .to_radians()
                            .cos();
                // |(high j w + b) / (j w + b)|, its pitch as the bilinear transform bends it.
                let b = 2.0 * 343.0 / 0.0875;
                let w =
                    2.0 * f64::from(RATE) * (std::f64::consts::PI * hertz / f64::from(RATE)).tan();
                let expected = ((high * w).hypot(b) / w.hypot(b)).log10() * 20.0;
                let samples = ear(&both, number);
                let original: Vec<f64> = voice.iter().map(|s| f64::from(*s)).collect();
                let got = (power(&samples) / power(&original)).log10() * 10.0;
                assert!(
                    (got - expected).abs() < 0.15,
                    "{hertz} Hz, {degrees}, ear {number}: {got:.2} dB, not {expected:.2}"
                );
            }
        }
    }
}

#[test]
fn what_has_no_place_or_an_absurd_one_is_heard_by_both_ears_alike_and_unchanged() {
    let voice = noise(4 * PIECE);
    for place in [None, Some(Vec3::NAN), Some(Vec3::INFINITY)] {
        let both = heard(&voice, |_| place);
        assert!(both.iter().all(|[left, right]| left == right), "{place:?}");
        let later = both.iter().skip(13).zip(&voice);
        assert!(
            later
                .into_iter()
                .all(|(heard, said)| (heard[0] - said).abs() < 1e-5),
            "{place:?}"
        );
    }
    let inside = heard(&voice, |_| Some(Vec3::ZERO));
    assert!(inside.iter().flatten().all(|sample| sample.is_finite()));
}

#[test]
fn half_the_distance_is_6_db_and_no_distance_hurts_or_is_silent() {
    let voice = tone(300.0, 20 * PIECE);
    let at = |distance: f32| {
        let both = heard(&voice, |_| Some(Vec3::NEG_Z * distance));
        power(&ear(&both, 0)).log10() * 10.0
    };
    let nearer = at(1.5) - at(3.0);
    assert!((nearer - 6.02).abs() < 0.05, "{nearer}");
    assert!(at(0.001) - at(1.5) < 6.1, "close to the ear");
    assert!(at(1.5) - at(500.0) < 12.1, "across the hall");
}

#[test]
fn a_voice_that_flies_around_the_head_does_not_click() {
    let voice = tone(300.0, 100 * PIECE);
    // A turn a second, which no one does.
    let both = heard(&voice, |k| {
        Some(beside(k as f64 / 100.0 * std::f64::consts::TAU))
    });
    let bend = |number: usize| {
        let samples = ear(&both, number);
        let bends = samples.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs());
        bends.fold(0.0, f64::max)
    };
    // Of the tone itself, twice as loud at most, and by Doppler a little higher.
    let own = 0.5 * (300.0 / f64::from(RATE) * std::f64::consts::TAU).powi(2);
    for number in [0, 1] {
        assert!(bend(number) < 2.5 * own, "{} of {own}", bend(number));
    }
}
