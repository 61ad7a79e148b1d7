//! The jitter buffer: frames arrive at any time and leave in order, each when it is due.
//!
//! A frame is due at its capture time plus an offset that adapts ([`PlayoutDelay`]). All frames that are due leave together
//! and the newest is the one to show: after an outage the past is not replayed. Time is an argument of every method; concealment while
//! no frame arrives is the receiver's.

use crate::delay::{self, LATE_US, PlayoutDelay};
use link_codec::{Micros, MotionFrame};
use std::{collections::VecDeque, time::Duration};

/// Frames kept at most: more than twice what [`JitterBuffer::MAX_DELAY`] holds at 120 Hz.
const WAITING: usize = 64;
/// What frames wait for something else grows and shrinks by one microsecond in so many: motion runs at half or one and a half times its speed.
const SLEW: i64 = 2;

/// What [`JitterBuffer::push`] did with a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// It waits for its time.
    InTime,
    /// It was due before it arrived, but nothing newer has been shown: it leaves with the next [`JitterBuffer::take`].
    Late,
    /// Something newer has been shown: dropped.
    Passed,
    /// It has arrived before: dropped.
    Duplicate,
    /// Its sequence or a time is out of range: dropped.
    Refused,
}

/// The times of a frame that is to be shown, by the viewer's clock but for `captured`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Timing {
    /// Capture, by the sender's clock.
    pub captured: Micros,
    /// Capture by the viewer's clock, if the offset was known when the frame arrived.
    pub captured_local: Option<Micros>,
    /// Arrival from the network.
    pub arrived: Micros,
    /// When it was due.
    pub due: Micros,
    /// When it left the buffer.
    pub released: Micros,
}

impl Timing {
    /// Capture to arrival, microseconds; may fall below zero by the clock offset's error.
    #[must_use]
    pub fn network_us(&self) -> Option<i64> {
        let captured = self.captured_local?;
        Some(self.arrived.signed().saturating_sub(captured.signed()))
    }

    /// Arrival to release.
    #[must_use]
    pub fn buffer(&self) -> Duration {
        Duration::from_micros(self.released.0.saturating_sub(self.arrived.0))
    }
}

/// A frame that left the buffer.
#[derive(Debug, Clone, PartialEq)]
pub struct Played {
    /// The frame.
    pub frame: MotionFrame,
    /// Its times.
    pub timing: Timing,
}

/// Counts since the buffer was made; delay and jitter of the last 5 s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlayoutStatistics {
    /// Frames pushed, with duplicates and refused ones.
    pub received: u64,
    /// Frames that arrived more than 1 ms after they were due and were shown.
    pub late: u64,
    /// Frames that arrived after a newer one had been shown.
    pub passed: u64,
    /// Frames that arrived after a newer one had arrived.
    pub reordered: u64,
    /// Frames that arrived again.
    pub duplicate: u64,
    /// Frames missing by gaps in the sequence; one that is still under way counts until it arrives.
    pub lost: u64,
    /// Frames dropped because too many waited.
    pub overflowed: u64,
    /// Frames whose sequence or time is out of range.
    pub refused: u64,
    /// Outages after which frames arrived too late for any delay.
    pub stalls: u64,
    /// What is added to the shortest transit so that frames arrive in time.
    pub delay: Duration,
    /// Median, 95th and 99th percentile of transit beyond the shortest.
    pub jitter: [Duration; 3],
}

#[derive(Debug, Clone)]
struct Waiting {
    frame: MotionFrame,
    captured_local: Option<Micros>,
    arrived: Micros,
}

/// Which sequences have arrived, as in RTP receivers (RFC 3550, appendix A).
#[derive(Debug, Clone, Copy, Default)]
struct Sequences {
    first: u32,
    highest: u32,
    /// Bit k: highest - k has arrived.
    seen: u128,
    /// Different ones.
    count: u64,
}

impl Sequences {
    fn lost(&self) -> u64 {
        let expected = if self.count == 0 {
            0
        } else {
            u64::from(self.highest - self.first) + 1
        };
        expected.saturating_sub(self.count)
    }

    /// Notes a sequence; whether it is the highest so far, or `None` if it has arrived before.
    fn note(&mut self, sequence: u32) -> Option<bool> {
        if self.count == 0 {
            (self.first, self.highest, self.seen) = (sequence, sequence, 1);
        } else if sequence > self.highest {
            let ahead = sequence - self.highest;
            self.seen = self.seen.checked_shl(ahead).unwrap_or(0) | 1;
            self.highest = sequence;
        } else {
            let bit = 1u128
                .checked_shl(self.highest - sequence)
                // Older than the bits: it was overtaken long ago and must not count twice.
                .filter(|bit| self.seen & bit == 0)?;
            self.seen |= bit;
            self.first = self.first.min(sequence);
            self.count += 1;
            return Some(false);
        }
        self.count += 1;
        Some(true)
    }
}

/// Holds frames until they are due.
#[derive(Debug, Clone)]
pub struct JitterBuffer {
    /// By sequence, oldest first.
    waiting: VecDeque<Waiting>,
    delay: PlayoutDelay,
    sequences: Sequences,
    /// Until then frames wait for something else: as [`Self::offset_us`], and how much later that is than they would be due, now.
    at_least: Option<i64>,
    waits: i64,
    last_arrived: i64,
    /// The newest sequence that has left.
    shown: Option<u32>,
    counts: PlayoutStatistics,
}

impl Default for JitterBuffer {
    fn default() -> Self {
        Self::new()
    }
}

impl JitterBuffer {
    /// No frame is held back longer than this.
    pub const MAX_DELAY: Duration = Duration::from_micros(delay::MOST_US.unsigned_abs());

    /// Empty, without delay.
    #[must_use]
    pub fn new() -> Self {
        Self {
            waiting: VecDeque::with_capacity(WAITING),
            delay: PlayoutDelay::new(),
            sequences: Sequences::default(),
            at_least: None,
            waits: 0,
            last_arrived: 0,
            shown: None,
            counts: PlayoutStatistics::default(),
        }
    }

    /// Begins another session, whose sequences and times begin anew: forgets frames, sequences and delays, keeps the counts.
    pub fn reset(&mut self) {
        self.counts.lost += self.sequences.lost();
        self.waiting.clear();
        self.delay.reset();
        self.sequences = Sequences::default();
        (self.at_least, self.waits) = (None, 0);
        self.shown = None;
    }

    /// Frames are not due before something else of the same capture: when that is there by the viewer's clock, minus its capture by the
    /// sender's, microseconds. The motion runs a little slower or faster until it fits.
    pub fn wait_for(&mut self, at_least: Option<i64>) {
        self.at_least = at_least;
    }

    /// Takes a frame that arrived at `arrived`. `captured_local` is its capture time by the viewer's clock, if the offset
    /// is known; it is passed through for reports, and the delay is computed from differences of transit.
    pub fn push(
        &mut self,
        frame: MotionFrame,
        arrived: Micros,
        captured_local: Option<Micros>,
    ) -> Arrival {
        self.counts.received += 1;
        if frame.sequence == 0 || frame.captured >= Micros::LATEST || arrived >= Micros::LATEST {
            self.counts.refused += 1;
            return Arrival::Refused;
        }
        let Some(newest) = self.sequences.note(frame.sequence) else {
            self.counts.duplicate += 1;
            return Arrival::Duplicate;
        };
        self.counts.reordered += u64::from(!newest);
        let (captured, here) = (frame.captured.signed(), arrived.signed());
        let late = here > self.due_us(captured, here) + LATE_US;
        self.delay.observe(captured, here, newest);
        self.follow(here);
        if self.shown.is_some_and(|shown| frame.sequence < shown) {
            self.counts.passed += 1;
            return Arrival::Passed;
        }
        if self.waiting.len() == WAITING {
            let oldest = self.waiting.pop_front();
            self.shown = self.shown.max(oldest.map(|w| w.frame.sequence));
            self.counts.overflowed += 1;
        }
        let place = self
            .waiting
            .partition_point(|w| w.frame.sequence < frame.sequence);
        self.waiting.insert(
            place,
            Waiting {
                frame,
                captured_local,
                arrived,
            },
        );
        if late {
            self.counts.late += 1;
            Arrival::Late
        } else {
            Arrival::InTime
        }
    }

    fn due(&self, waiting: &Waiting) -> Micros {
        let due = self.due_us(waiting.frame.captured.signed(), waiting.arrived.signed());
        Micros(due.max(0).unsigned_abs())
    }

    fn due_us(&self, captured: i64, arrived: i64) -> i64 {
        later(&self.delay, self.waits, captured, arrived)
    }

    /// Goes on towards what [`Self::wait_for`] asked for.
    fn follow(&mut self, arrived: i64) {
        let own = self.delay.offset_us();
        let wanted =
            (self.at_least.zip(own)).map_or(0, |(at_least, own)| at_least.saturating_sub(own));
        let wanted = wanted.clamp(0, delay::MOST_US);
        let span = (arrived - self.last_arrived).clamp(0, delay::SPAN_US);
        let most = span / SLEW;
        self.waits += (wanted - self.waits).clamp(-most, most);
        self.last_arrived = self.last_arrived.max(arrived);
    }

    /// Removes and returns all frames that are due at `now`, oldest first: the last is the one to show, those before it serve velocities and
    /// interpolation. Does not allocate.
    pub fn take(
        &mut self,
        now: Micros,
    ) -> impl DoubleEndedIterator<Item = Played> + ExactSizeIterator + '_ {
        let due = self
            .waiting
            .iter()
            .rposition(|w| self.due(w) <= now)
            .map_or(0, |newest| newest + 1);
        if let Some(newest) = due.checked_sub(1).and_then(|k| self.waiting.get(k)) {
            self.shown = self.shown.max(Some(newest.frame.sequence));
        }
        let (delay, waits) = (&self.delay, self.waits);
        self.waiting.drain(..due).map(move |w| {
            let due = later(delay, waits, w.frame.captured.signed(), w.arrived.signed());
            Played {
                timing: Timing {
                    captured: w.frame.captured,
                    captured_local: w.captured_local,
                    arrived: w.arrived,
                    due: Micros(due.max(0).unsigned_abs()),
                    released: now,
                },
                frame: w.frame,
            }
        })
    }

    /// The oldest frame that waits and when it is due, for interpolating towards it and for sleeping until then.
    #[must_use]
    pub fn next(&self) -> Option<(&MotionFrame, Micros)> {
        self.waiting.front().map(|w| (&w.frame, self.due(w)))
    }

    /// When a frame is due by the viewer's clock, minus its capture by the sender's, microseconds; `None` before the first frame.
    #[must_use]
    pub fn offset_us(&self) -> Option<i64> {
        self.delay.offset_us().map(|own| own + self.waits)
    }

    /// How many frames wait.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// What is added to the shortest transit, now.
    #[must_use]
    pub fn delay(&self) -> Duration {
        Duration::from_micros(self.delay.added_us() + self.waits.unsigned_abs())
    }

    /// Counts since the buffer was made, delay and jitter now.
    #[must_use]
    pub fn statistics(&self) -> PlayoutStatistics {
        PlayoutStatistics {
            lost: self.counts.lost + self.sequences.lost(),
            stalls: self.delay.stalls(),
            delay: self.delay(),
            jitter: self
                .delay
                .jitter_us([0.5, 0.95, 0.99])
                .map(Duration::from_micros),
            ..self.counts
        }
    }
}

/// When a frame is due that waits for something else besides; it is held back no longer than any other.
fn later(delay: &PlayoutDelay, waits: i64, captured: i64, arrived: i64) -> i64 {
    (delay.due(captured, arrived) + waits).min(arrived + delay::MOST_US)
}

#[cfg(test)]
mod tests;
