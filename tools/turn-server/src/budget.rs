//! A bound on a rate, as a bucket of tokens that fills up again.

use std::time::{Duration, Instant};

/// A bucket with room for one second's tokens, or for those of some more.
#[derive(Debug)]
pub(crate) struct Budget {
    per_second: u64,
    /// How long it takes to fill.
    room: Duration,
    /// Tokens, in billionths, so that nothing is lost between two close calls.
    nano_tokens: u128,
    filled: Instant,
}

impl Budget {
    /// A full one.
    pub(crate) fn new(per_second: u64, now: Instant) -> Self {
        Self::with_room(per_second, Duration::from_secs(1), now)
    }

    /// A full one that takes `room` to fill.
    pub(crate) fn with_room(per_second: u64, room: Duration, now: Instant) -> Self {
        Self {
            per_second,
            room,
            nano_tokens: u128::from(per_second) * room.as_nanos(),
            filled: now,
        }
    }

    /// Whether it is full at `now`, so that a new one would be the same.
    pub(crate) fn is_full(&self, now: Instant) -> bool {
        let passed = now.saturating_duration_since(self.filled).as_nanos();
        let full = u128::from(self.per_second) * self.room.as_nanos();
        self.nano_tokens + passed.saturating_mul(self.per_second.into()) >= full
    }

    /// Takes `tokens`, if there are as many.
    pub(crate) fn take(&mut self, tokens: usize, now: Instant) -> bool {
        let passed = now.saturating_duration_since(self.filled).min(self.room);
        let full = u128::from(self.per_second) * self.room.as_nanos();
        self.nano_tokens =
            (self.nano_tokens + passed.as_nanos() * u128::from(self.per_second)).min(full);
        self.filled = now;
        let wanted = tokens as u128 * 1_000_000_000;
        let enough = wanted <= self.nano_tokens;
        if enough {
            self.nano_tokens -= wanted;
        }
        enough
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_than_the_rate_passes_and_no_less() {
        let begin = Instant::now();
        let mut budget = Budget::new(1000, begin);
        // Ten times the rate for ten seconds, in steps of a millisecond: a full bucket, then the rate.
        let passed = (0..10_000)
            .filter(|ms| budget.take(10, begin + Duration::from_millis(*ms)))
            .count();
        assert!((1095..=1100).contains(&passed), "{passed} packets of 10");
        // After a long pause no more than one second's worth.
        let later = begin + Duration::from_secs(3600);
        let burst = (0..1000).filter(|_| budget.take(10, later)).count();
        assert_eq!(burst, 100);
    }
}
