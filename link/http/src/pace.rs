//! How fast a download has to be.

use std::time::Duration;
use tokio::time::Instant;

/// Bytes a second that a download brings at least, in each window of it and as a whole: a quarter of a line of 64
/// kbit/s, since the call's motion and voice may take the rest.
const LEAST_PER_SECOND: u64 = 2 << 10;

/// What a whole download may take besides: for pauses before retries and a server's restart.
const SLACK: Duration = Duration::from_secs(600);

/// The longest that a download of so many bytes may take, retries included: of the demo person's 17 MB two hours and a
/// half.
pub(crate) fn longest(bytes: u64) -> Duration {
    SLACK + Duration::from_secs(bytes / LEAST_PER_SECOND)
}

/// The bytes that came since a window began.
#[derive(Debug)]
pub(crate) struct Pace {
    window: Duration,
    begun: Instant,
    came: u64,
}

impl Pace {
    pub(crate) fn new(window: Duration) -> Self {
        Self {
            window,
            begun: Instant::now(),
            came: 0,
        }
    }

    /// When the window ends.
    pub(crate) fn ends(&self) -> Instant {
        self.begun + self.window
    }

    /// Counts `bytes` that have come.
    pub(crate) fn add(&mut self, bytes: u64) {
        self.came = self.came.saturating_add(bytes);
    }

    /// At the end of a window: the bytes a second that came in it, if they are enough, and the next window begins.
    pub(crate) fn next(&mut self) -> Option<u64> {
        let seconds = self.begun.elapsed().as_secs().max(1);
        let rate = self.came / seconds;
        *self = Self::new(self.window);
        (rate >= LEAST_PER_SECOND).then_some(rate)
    }
}
