//! The playout delay: the time from capture by the sender's clock to display by the viewer's, adapted to the jitter.
//!
//! Works on *transit*, arrival by the viewer's clock minus capture by the sender's. The clocks' offset is in every transit and in the
//! least of them alike, so it need not be known. After WebRTC's NetEq (a percentile of the relative
//! delay over a window; quickly up, slowly down).

use std::collections::VecDeque;

/// No frame is held back longer than this, microseconds.
pub const MOST_US: i64 = 200_000;
/// The window of transits: this long, and this many frames at most.
const WINDOW_US: i64 = 5_000_000;
const WINDOW_FRAMES: usize = 512;
/// Share of frames that shall arrive in time.
const IN_TIME: f64 = 0.98;
/// The delay grows by at most this share of the time that passes: motion runs at half its speed until it fits.
const RISE: f64 = 0.5;
/// Each second it falls by this share of the excess, and at least by [`FALL_LEAST`] microseconds a second.
const FALL: f64 = 0.25;
const FALL_LEAST: f64 = 10_000.0;
/// Longer steps between two frames count as this.
pub(crate) const SPAN_US: i64 = 100_000;
/// Frames late by more than [`MOST_US`] for this long are no stall: the path has become longer.
const STALL_US: i64 = 1_000_000;

/// A frame that is late by no more than this is still shown in the same picture, microseconds.
pub(crate) const LATE_US: i64 = 1_000;

/// The adapted delay of one stream, of motion or of voice. Times are microseconds, each by the clock that its name says.
#[derive(Debug, Clone)]
pub struct PlayoutDelay {
    /// (arrived, transit), oldest first.
    window: VecDeque<(i64, i64)>,
    scratch: Vec<i64>,
    /// Display by the viewer's clock minus capture by the sender's; `None` before the first frame.
    offset: Option<i64>,
    /// Arrival of the first frame of a stall that still lasts.
    stalled_since: Option<i64>,
    stalls: u64,
    last_arrived: i64,
}

impl PlayoutDelay {
    /// Without a frame yet.
    #[must_use]
    pub fn new() -> Self {
        Self {
            window: VecDeque::with_capacity(WINDOW_FRAMES),
            scratch: Vec::with_capacity(WINDOW_FRAMES),
            offset: None,
            stalled_since: None,
            stalls: 0,
            last_arrived: 0,
        }
    }

    /// Begins another session, whose times begin anew.
    pub fn reset(&mut self) {
        self.window.clear();
        self.offset = None;
        self.stalled_since = None;
    }

    /// The least transit of the window.
    fn base(&self) -> Option<i64> {
        self.window.iter().map(|(_, transit)| *transit).min()
    }

    /// Display by the viewer's clock minus capture by the sender's; `None` before the first frame.
    #[must_use]
    pub fn offset_us(&self) -> Option<i64> {
        self.offset
    }

    /// Outages after which frames arrived too late for any delay.
    #[must_use]
    pub fn stalls(&self) -> u64 {
        self.stalls
    }

    /// What is added to the least transit, microseconds.
    #[must_use]
    pub fn added_us(&self) -> u64 {
        match (self.offset, self.base()) {
            (Some(offset), Some(base)) => (offset - base).max(0).unsigned_abs(),
            _ => 0,
        }
    }

    /// When a frame is due, by the viewer's clock.
    #[must_use]
    pub fn due(&self, captured: i64, arrived: i64) -> i64 {
        let offset = self.offset.unwrap_or(arrived - captured);
        (captured + offset).min(arrived + MOST_US)
    }

    /// Percentiles of transit beyond the least one, microseconds; zero before the first frame.
    #[must_use]
    pub fn jitter_us<const N: usize>(&self, shares: [f64; N]) -> [u64; N] {
        let mut sorted: Vec<_> = self.window.iter().map(|(_, transit)| *transit).collect();
        sorted.sort_unstable();
        shares.map(|share| match sorted.first() {
            Some(base) => (sorted[rank(sorted.len(), share)] - base).unsigned_abs(),
            None => 0,
        })
    }

    /// Adapts to one frame's arrival; `newest` if no frame captured later has arrived.
    pub fn observe(&mut self, captured: i64, arrived: i64, newest: bool) {
        let transit = arrived - captured;
        while self.window.len() >= WINDOW_FRAMES
            || self
                .window
                .front()
                .is_some_and(|(at, _)| arrived - at > WINDOW_US)
        {
            self.window.pop_front();
        }
        if self.is_stall(captured, arrived, newest) {
            return;
        }
        self.window.push_back((arrived, transit));
        self.follow(transit, arrived);
    }

    /// Whether a frame was held up by an outage. No delay within bounds would have been long enough for it, and many of them must not
    /// raise the delay of the next seconds: only the newest of them is of use.
    fn is_stall(&mut self, captured: i64, arrived: i64, newest: bool) -> bool {
        let Some(base) = self.base() else {
            self.stalled_since = None;
            return false;
        };
        let in_time = arrived <= self.due(captured, arrived) + LATE_US;
        let hopeless = arrived - captured - base > MOST_US;
        match self.stalled_since {
            // Overtaken: reordered by the network, or the last of a longer path.
            None if hopeless && !newest => true,
            None if hopeless => {
                self.stalls += 1;
                self.stalled_since = Some(arrived);
                true
            }
            None => false,
            Some(_) if in_time => {
                self.stalled_since = None;
                false
            }
            Some(since) if arrived - since > STALL_US => {
                self.stalled_since = None;
                self.window.clear();
                false
            }
            Some(_) => true,
        }
    }

    fn follow(&mut self, transit: i64, arrived: i64) {
        self.scratch.clear();
        self.scratch
            .extend(self.window.iter().map(|(_, transit)| *transit));
        let rank = rank(self.scratch.len(), IN_TIME);
        let (_, wanted, _) = self.scratch.select_nth_unstable(rank);
        let wanted = *wanted;
        let base = self.base().unwrap_or(transit);
        let span = (arrived - self.last_arrived).clamp(0, SPAN_US) as f64;
        let offset = match self.offset {
            None => wanted,
            Some(offset) if offset < wanted => (offset + whole(RISE * span)).min(wanted),
            Some(offset) => {
                let rate = (FALL * (offset - wanted) as f64).max(FALL_LEAST);
                (offset - whole(rate * span * 1e-6)).max(wanted)
            }
        };
        self.offset = Some(offset.clamp(base, base + MOST_US));
        self.last_arrived = self.last_arrived.max(arrived);
    }
}

impl Default for PlayoutDelay {
    fn default() -> Self {
        Self::new()
    }
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "the cast saturates, and delays are below 2^62"
)]
fn whole(value: f64) -> i64 {
    value.round() as i64
}

/// Place of a percentile among `count` > 0 sorted values.
fn rank(count: usize, share: f64) -> usize {
    let above = whole((1.0 - share) * count as f64 - 0.5);
    count
        .saturating_sub(1)
        .saturating_sub(usize::try_from(above).unwrap_or(0))
}
