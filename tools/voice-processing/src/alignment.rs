//! What the loudspeaker plays, by the microphone's clock: an echo canceller needs a sample of the one for each sample of the other.

use crate::far_end::Played;
use crate::{PIECE, RATE};
use std::collections::VecDeque;
use std::time::Instant;

/// Samples that are kept: a second of what was played, also ahead of being heard.
const KEPT: usize = RATE as usize;
/// Devices say when their samples are in the air, to within some milliseconds. The reference is ahead of the microphone by so much, in samples,
/// since an echo canceller finds what comes late and cannot find what comes early: 20 ms.
const AHEAD: f64 = 960.0;
/// Further away than this, in samples, it was no drift: one of the devices stood still, or has a new delay. 20 ms.
const JUMP: f64 = 960.0;
/// What is left of a difference after so many samples is 1/e: 10 s. Slow, because the devices' times are noisy.
const SETTLING: f64 = 10.0 * RATE as f64;
/// Clocks of sound devices differ by less.
const MOST_DRIFT: f64 = 1e-3;

/// What was played, and where in it the microphone is.
#[derive(Debug)]
pub(crate) struct Alignment {
    played: VecDeque<f32>,
    /// Samples that came before those in `played`.
    gone: u64,
    /// The newest piece's first sample, counted from the first one of all, and when it is heard.
    newest: Option<(u64, Instant)>,
    /// The sample that is next for the microphone; between two samples as a rule.
    next: f64,
}

impl Alignment {
    pub(crate) fn new() -> Self {
        Self {
            played: VecDeque::with_capacity(KEPT + PIECE),
            gone: 0,
            newest: None,
            next: 0.0,
        }
    }

    /// Takes up what was played next.
    pub(crate) fn play(&mut self, (heard, piece): &Played) {
        self.newest = Some((self.gone + self.played.len() as u64, *heard));
        self.played.extend(piece);
        let old = self.played.len().saturating_sub(KEPT);
        self.played.drain(..old);
        self.gone += old as u64;
    }

    /// What the loudspeaker plays while the microphone hears the piece that begins at `spoken`, [`AHEAD`] of it. Silence where nothing is
    /// known to be played.
    pub(crate) fn reference(&mut self, spoken: Instant, out: &mut [f32; PIECE]) {
        let Some((index, heard)) = self.newest else {
            out.fill(0.0);
            return;
        };
        let seconds = if spoken >= heard {
            (spoken - heard).as_secs_f64()
        } else {
            -(heard - spoken).as_secs_f64()
        };
        let due = index as f64 + seconds * f64::from(RATE) + AHEAD;
        let away = due - self.next;
        if away.abs() > JUMP {
            self.next = due;
        }
        let away = due - self.next;
        let step = 1.0 + (away / SETTLING).clamp(-MOST_DRIFT, MOST_DRIFT);
        for out in out {
            *out = self.at(self.next);
            self.next += step;
        }
    }

    /// Between the samples, by a cubic (Catmull and Rom, "A class of local interpolating splines", 1974).
    fn at(&self, position: f64) -> f32 {
        let whole = position.floor();
        #[allow(clippy::cast_possible_truncation, reason = "it is from 0 to 1")]
        let t = (position - whole) as f32;
        let [a, b, c, d] = [-1.0, 0.0, 1.0, 2.0].map(|k| self.sample(whole + k));
        b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a whole number, not below zero, saturating"
    )]
    fn sample(&self, index: f64) -> f32 {
        let within = index - self.gone as f64;
        if within < 0.0 {
            return 0.0;
        }
        self.played.get(within as usize).copied().unwrap_or(0.0)
    }
}
