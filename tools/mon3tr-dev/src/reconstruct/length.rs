//! How long a training takes, and how much of it is done.

use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Looks at the pictures that were held back: so often in a training, but not more than once a minute.
const MARKS: f64 = 30.0;
/// Of a training by steps, whose marks must not depend on the time.
const STEP_MARKS: f64 = 16.0;

/// When a training ends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum Length {
    /// After so much time.
    Minutes(f64),
    /// After so many steps: then the result does not depend on the machine's speed.
    Steps(u64),
}

/// What a checkpoint keeps of the time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Note {
    /// Seconds that were used.
    pub(super) seconds: f64,
    /// How long the training was to be.
    pub(super) length: Length,
}

/// How far a training is.
#[derive(Debug)]
pub(super) struct Clock {
    length: Length,
    /// Seconds that were used before.
    before: f64,
    start: Instant,
}

impl Clock {
    /// `used` seconds were used before.
    pub(super) fn new(length: Length, used: f64) -> Self {
        Self {
            length,
            before: used.max(0.0),
            start: Instant::now(),
        }
    }

    /// What to keep in a checkpoint.
    pub(super) fn note(&self) -> Note {
        Note {
            seconds: self.used(),
            length: self.length,
        }
    }

    /// Seconds that the training took so far.
    pub(super) fn used(&self) -> f64 {
        self.before + self.used_here()
    }

    /// Seconds that it took since it was begun or taken up.
    pub(super) fn used_here(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// How much is done after `steps` steps, 0 to 1 and beyond.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "a share"
    )]
    pub(super) fn progress(&self, steps: u64) -> f32 {
        match self.length {
            Length::Minutes(minutes) => (self.used() / (60.0 * minutes)) as f32,
            Length::Steps(all) => (steps as f64 / all as f64) as f32,
        }
    }

    /// The progress at which pictures are looked at next.
    #[expect(clippy::cast_possible_truncation, reason = "a share")]
    pub(super) fn next_mark(&self, steps: u64) -> f32 {
        let marks = match self.length {
            Length::Minutes(minutes) => minutes.floor().clamp(4.0, MARKS),
            Length::Steps(_) => STEP_MARKS,
        };
        let done = f64::from(self.progress(steps));
        (((done * marks + 1e-6).floor() + 1.0) / marks) as f32
    }

    /// The progress at which pictures are looked at first, after `steps` steps: at once, so that a package is there whatever comes. A training by
    /// steps that is taken up waits for its next mark, as looks decide which package stays: it has those of a training that was not interrupted.
    pub(super) fn first_look(&self, steps: u64) -> f32 {
        match self.length {
            Length::Steps(_) if steps > 0 => self.next_mark(steps),
            Length::Steps(_) | Length::Minutes(_) => self.progress(steps),
        }
    }

    /// Whether looks between marks may decide which package stays.
    pub(super) fn decides_between_marks(&self) -> bool {
        matches!(self.length, Length::Minutes(_))
    }

    /// Seconds left, if steps go on as fast as they went here; nothing before it is known.
    #[expect(clippy::cast_precision_loss, reason = "counts of steps")]
    pub(super) fn left(&self, steps: u64, steps_here: u64) -> Option<f64> {
        match self.length {
            Length::Minutes(minutes) => Some((60.0 * minutes - self.used()).max(0.0)),
            Length::Steps(all) => (steps_here > 0).then(|| {
                let each = self.used_here() / steps_here as f64;
                all.saturating_sub(steps) as f64 * each
            }),
        }
    }
}

impl Length {
    /// Whether a training can be so long: a file may say anything.
    pub(super) fn is_possible(self) -> bool {
        match self {
            Self::Minutes(minutes) => (0.01..=10_000.0).contains(&minutes),
            Self::Steps(steps) => steps > 0,
        }
    }
}

/// Minutes of a training.
pub(super) fn parse_minutes(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(minutes) if Length::Minutes(minutes).is_possible() => Ok(minutes),
        _ => Err("minutes from 0.01 to 10,000".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_training_by_steps_is_as_far_as_its_steps() {
        let clock = Clock::new(Length::Steps(200), 5.0);
        assert!((clock.progress(50) - 0.25).abs() < 1e-6, "a quarter");
        assert!((clock.next_mark(50) - 0.3125).abs() < 1e-6, "the next mark");
        assert!(clock.used() >= 5.0, "with what was used before");
        assert!(clock.first_look(0) <= 0.0, "at once");
        assert!(
            (clock.first_look(51) - 0.3125).abs() < 1e-6,
            "taken up, at the mark that it would have had"
        );
        assert!(!clock.decides_between_marks(), "and no other counts");
    }

    #[test]
    fn a_checkpoint_keeps_how_long_the_training_was_to_be() {
        for length in [Length::Steps(200), Length::Minutes(1.5)] {
            let note = Clock::new(length, 5.0).note();
            let text = serde_json::to_string(&note).expect("a text");
            let back: Note = serde_json::from_str(&text).expect("read");
            assert_eq!(back.length, length, "{text}");
            assert!(back.seconds >= 5.0, "{text}");
        }
        for length in [
            Length::Steps(0),
            Length::Minutes(0.0),
            Length::Minutes(f64::NAN),
        ] {
            assert!(!length.is_possible(), "{length:?}");
        }
    }

    #[test]
    fn minutes_are_numbers_that_end() {
        for text in ["0", "-1", "nan", "inf", "x"] {
            assert!(parse_minutes(text).is_err(), "{text}");
        }
        assert_eq!(parse_minutes("12.5"), Ok(12.5), "minutes");
    }
}
