//! A length's neutral value for one person, found while they are watched.
//!
//! It is a quantile of what was seen: mouths are mostly shut, eyes mostly open. The first second gives it from its own samples,
//! pulled towards what people have on average; afterwards it follows slowly, so that neither a long smile nor a
//! new distance from the camera stays in it for ever.

/// Time of the first samples, seconds, and how many of them are kept.
const FIRST_SECONDS: f64 = 1.0;
const FIRST_SAMPLES: usize = 64;
/// How many samples the average of people counts for.
const PRIOR_SAMPLES: f64 = 3.0;

/// What is known of a length before anyone is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Usual {
    /// Average of people.
    pub(super) value: f64,
    /// How far a person may be from it.
    pub(super) range: f64,
    /// Share of the time that the length is below its neutral value.
    pub(super) quantile: f64,
    /// How fast the neutral value may follow, per second.
    pub(super) rate: f64,
}

/// The neutral value of one length.
#[derive(Debug, Clone)]
pub(super) struct Neutral {
    usual: Usual,
    value: f64,
    first: [f64; FIRST_SAMPLES],
    count: usize,
    seconds: f64,
    is_held: bool,
}

impl Neutral {
    pub(super) fn new(usual: Usual) -> Self {
        Self {
            usual,
            value: usual.value,
            first: [0.0; FIRST_SAMPLES],
            count: 0,
            seconds: 0.0,
            is_held: false,
        }
    }

    /// Follows no more, once the first second has given the value.
    pub(super) fn hold(&mut self) {
        self.is_held = true;
    }

    /// Takes a finite `sample` that was seen `seconds` (at least 0) after the one before.
    pub(super) fn see(&mut self, sample: f64, seconds: f64) {
        let Usual {
            value: usual,
            range,
            quantile,
            rate,
        } = self.usual;
        let sample = sample.clamp(usual - range, usual + range);
        self.seconds += seconds;
        if self.seconds <= FIRST_SECONDS && self.count < FIRST_SAMPLES {
            self.first[self.count] = sample;
            self.count += 1;
            let seen = &mut self.first[..self.count];
            seen.sort_unstable_by(f64::total_cmp);
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a share of at most 64"
            )]
            let place = (quantile * (self.count - 1) as f64).round() as usize;
            let found = seen.get(place).copied().unwrap_or(usual);
            let count = self.count as f64;
            self.value = (found * count + usual * PRIOR_SAMPLES) / (count + PRIOR_SAMPLES);
            return;
        }
        if self.is_held {
            return;
        }
        // Steps up and down balance where `quantile` of the samples are below.
        let (up, down) = (rate * quantile * seconds, rate * (1.0 - quantile) * seconds);
        self.value = if sample > self.value {
            (self.value + up).min(sample)
        } else {
            (self.value - down).max(sample)
        };
    }

    /// The neutral value.
    pub(super) fn value(&self) -> f64 {
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const USUAL: Usual = Usual {
        value: 1.0,
        range: 0.5,
        quantile: 0.5,
        rate: 0.1,
    };

    #[test]
    fn what_is_held_before_it_was_learnt_is_learnt_first_and_then_stays() {
        let mut neutral = Neutral::new(USUAL);
        neutral.hold();
        for _ in 0..30 {
            neutral.see(1.3, 1.0 / 30.0);
        }
        let learnt = neutral.value();
        assert!((learnt - 1.3).abs() < 0.03, "{learnt} of 1.3");
        for _ in 0..3000 {
            neutral.see(0.7, 1.0 / 30.0);
        }
        assert!(
            (neutral.value() - learnt).abs() < 0.03,
            "held: {} after {learnt}",
            neutral.value()
        );
    }

    #[test]
    fn what_is_not_held_follows_slowly() {
        let mut neutral = Neutral::new(USUAL);
        for _ in 0..30 {
            neutral.see(1.3, 1.0 / 30.0);
        }
        for _ in 0..3000 {
            neutral.see(0.7, 1.0 / 30.0);
        }
        assert!((neutral.value() - 0.7).abs() < 0.03, "{}", neutral.value());
    }
}
