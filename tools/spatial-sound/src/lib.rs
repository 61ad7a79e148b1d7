//! A voice heard from a place: what reaches both ears of a listener's head ([`Binaural`]).
//!
//! The head is a rigid sphere, after Brown and Duda, "A Structural Model for Binaural Sound Synthesis", IEEE Transactions on Speech and Audio Processing 6(5), 1998:
//! the delay of each ear (their equation 4), the head's shadow as a filter of first order (equations 5 and 6). There is no pinna and no room, so above and
//! below, before and behind sound alike while the head is at rest; a head that turns tells them apart.
//!
//! A place is in the listener's head: metres, x right, y up, -z ahead, as OpenXR has a head; the origin is between the ears. Everything is 48 kHz.

#![forbid(unsafe_code)]

mod delay_line;

use delay_line::DelayLine;
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI};

/// Samples a second.
pub const RATE: u32 = 48_000;

/// The head's radius, metres, and the speed of sound, metres a second.
pub const HEAD_RADIUS: f32 = 0.0875;
/// Metres a second.
pub const SPEED_OF_SOUND: f32 = 343.0;

/// From here a voice is as loud as it was captured, metres: about where people stand who talk.
pub const REFERENCE_DISTANCE: f32 = 1.5;
/// Loudness is that of a point's sound, the reciprocal of the distance, between these: who whispers into an ear must not hurt it, and who is across the hall is heard.
const LEAST_GAIN: f32 = 0.25;
const MOST_GAIN: f32 = 2.0;

/// Of the shadow (equation 6): the least share of high sound, and from which angle it comes, radians.
const SHADOW_LEAST: f32 = 0.1;
const SHADOW_ANGLE: f32 = 150.0 / 180.0 * PI;

/// One voice's way to both ears. It follows the place smoothly: over each piece from the place of the piece before.
#[derive(Debug, Clone, Default)]
pub struct Binaural {
    line: DelayLine,
    /// The left one and the right one.
    ears: [Ear; 2],
}

#[derive(Debug, Clone, Default)]
struct Ear {
    /// At the end of the last piece.
    heard: Option<Heard>,
    /// The filter's last input and output.
    last: [f32; 2],
}

/// How an ear hears a place.
#[derive(Debug, Clone, Copy)]
struct Heard {
    /// Samples later than the sphere's nearest point to the source.
    delay: f32,
    /// Share of the high frequencies.
    high: f32,
    /// Of all.
    gain: f32,
}

impl Heard {
    /// Of no place: both ears hear the same, unfiltered, about as late as what is straight ahead, by whole samples.
    const NOWHERE: Self = Self {
        delay: 12.0,
        high: 1.0,
        gain: 1.0,
    };

    /// `ear` is the ear's direction.
    fn from(place: Vec3, ear: Vec3) -> Self {
        let distance = place.length();
        let cosine = (place.dot(ear) / distance.max(f32::MIN_POSITIVE)).clamp(-1.0, 1.0);
        let angle = cosine.acos();
        // Around the sphere where it does not see the source.
        let way = if angle <= FRAC_PI_2 {
            1.0 - cosine
        } else {
            1.0 + angle - FRAC_PI_2
        };
        Self {
            delay: way * HEAD_RADIUS / SPEED_OF_SOUND * RATE as f32,
            high: (1.0 + SHADOW_LEAST / 2.0)
                + (1.0 - SHADOW_LEAST / 2.0) * (angle / SHADOW_ANGLE * PI).cos(),
            gain: (REFERENCE_DISTANCE / distance.max(f32::MIN_POSITIVE))
                .clamp(LEAST_GAIN, MOST_GAIN),
        }
    }

    /// Part of the way to another.
    fn towards(self, other: Self, share: f32) -> Self {
        let mix = |a: f32, b: f32| a + (b - a) * share;
        Self {
            delay: mix(self.delay, other.delay),
            high: mix(self.high, other.high),
            gain: mix(self.gain, other.gain),
        }
    }
}

impl Ear {
    /// The shadow's filter: (high s + b) / (s + b) with b = 2 c / a, by the bilinear transform.
    fn shadow(&mut self, sample: f32, high: f32) -> f32 {
        const CORNER: f32 = 2.0 * SPEED_OF_SOUND / HEAD_RADIUS;
        const STEP: f32 = 2.0 * RATE as f32;
        const WHOLE: f32 = (CORNER + STEP).recip();
        let [input, output] = self.last;
        let heard = (CORNER + STEP * high) * WHOLE * sample
            + (CORNER - STEP * high) * WHOLE * input
            - (CORNER - STEP) * WHOLE * output;
        // What has faded below all hearing must not go on as numbers that are slow to compute.
        let heard = if heard.abs() < 1e-20 { 0.0 } else { heard };
        self.last = [sample, heard];
        heard
    }
}

impl Binaural {
    /// Adds the next samples of the voice to what both ears hear, left and right, as many as there are of both. The voice comes from `place` by the end of this piece;
    /// of no place, or one that is not finite, it is heard in both ears alike.
    pub fn add(&mut self, voice: &[f32], place: Option<Vec3>, heard: &mut [[f32; 2]]) {
        let place = place.filter(|place| place.is_finite());
        let now = [Vec3::NEG_X, Vec3::X]
            .map(|ear| place.map_or(Heard::NOWHERE, |place| Heard::from(place, ear)));
        let before = [&self.ears[0], &self.ears[1]].map(|ear| ear.heard);
        let count = voice.len().min(heard.len());
        for (k, (sample, out)) in voice.iter().zip(heard).enumerate() {
            self.line.push(*sample);
            let share = (k + 1) as f32 / count as f32;
            let ears = self.ears.iter_mut().zip(before).zip(now).zip(out);
            for (((ear, before), now), out) in ears {
                let at = before.unwrap_or(now).towards(now, share);
                let delayed = self.line.read(at.delay);
                *out += at.gain * ear.shadow(delayed, at.high);
            }
        }
        for (ear, now) in self.ears.iter_mut().zip(now) {
            ear.heard = Some(now);
        }
    }
}
