//! The even pace of pieces of sound that no device asks for.

use std::time::{Duration, Instant};

/// Behind by more than this, what was missed is left out: the machine was suspended, or the process.
const MOST_BEHIND: Duration = Duration::from_millis(200);

/// When each piece of sound begins, one after the other, by this machine's clock.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    next: Instant,
    piece: Duration,
}

impl Pace {
    /// Pieces as long as `piece`, the first of which begins at `now`.
    #[must_use]
    pub const fn begin(now: Instant, piece: Duration) -> Self {
        Self { next: now, piece }
    }

    /// When the next piece begins: where the one before ends, or `now` where that is long past.
    pub fn next(&mut self, now: Instant) -> Instant {
        let is_late = now.saturating_duration_since(self.next) > MOST_BEHIND;
        let begins = if is_late { now } else { self.next };
        self.next = begins + self.piece;
        begins
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_follow_one_another_and_a_long_pause_is_left_out() {
        let piece = Duration::from_millis(20);
        let begun = Instant::now();
        let at = |ms| begun + Duration::from_millis(ms);
        let mut pace = Pace::begin(begun, piece);
        // Asked for early, in time and late, all the same.
        for (number, now) in (0..).zip([0, 5, 40, 90, 160, 170]) {
            assert_eq!(pace.next(at(now)), begun + piece * number, "{now}");
        }
        // After an hour there is one piece, not all of the hour's.
        assert_eq!(pace.next(at(3_600_000)), at(3_600_000));
        assert_eq!(pace.next(at(3_600_001)), at(3_600_020));
    }
}
