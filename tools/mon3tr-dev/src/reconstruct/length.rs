//! How long a training takes, and how much of it is done.

use std::time::Instant;

/// Looks at the pictures that were held back: so often in a training, but not more than once a minute.
const MARKS: f64 = 30.0;
/// Of a training by steps, whose marks must not depend on the time.
const STEP_MARKS: f64 = 16.0;

/// When a training ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Length {
    /// After so much time.
    Minutes(f64),
    /// After so many steps: then the result does not depend on the machine's speed.
    Steps(u64),
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

/// Minutes of a training.
pub(super) fn parse_minutes(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(minutes) if (0.01..=10_000.0).contains(&minutes) => Ok(minutes),
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
    }

    #[test]
    fn minutes_are_numbers_that_end() {
        for text in ["0", "-1", "nan", "inf", "x"] {
            assert!(parse_minutes(text).is_err(), "{text}");
        }
        assert_eq!(parse_minutes("12.5"), Ok(12.5), "minutes");
    }
}
