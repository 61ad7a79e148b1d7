//! Two programs' clocks: the offset of the sender's from this program's, from the four times of feedback and pong (`docs/protocol.md`).
//!
//! Only [`Clock`] reads the system's clock; the rest is arithmetic on its arguments. A constant asymmetry of the path cannot be
//! distinguished from an offset: [`ClockOffset::uncertainty`] bounds the error.

use link_codec::Micros;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Length of a bucket of the sliding window, and how many there are: 16 s in all.
const BUCKET_US: i64 = 250_000;
const BUCKETS: usize = 64;
/// How fast two quartz clocks may drift apart, by which an older exchange counts for less (NTP's dispersion, RFC 5905
/// section 11, uses 15 for servers; phones are worse).
const DRIFT_PPM: i64 = 60;
/// How far below zero the two directions' shortest delays may add up, by rounding and jumps of a scheduler's tick.
const TOLERANCE_US: i64 = 500;
/// A pong later than this is ignored.
const OLDEST_US: i64 = 10_000_000;
/// After so many exchanges in a row that contradict the window, the sender's clock counts as replaced.
const CONTRADICTIONS: u32 = 8;
/// Nothing is slewed for this many exchanges: the first one may have met a spike of delay.
const ACQUIRING: u32 = 4;
/// The mapping moves towards a new estimate by this share of the time between exchanges at most ...
const SLEW: f64 = 0.05;
/// ... of which no more than this counts, so that one exchange moves it by [`ClockOffset::MAX_STEP_US`] at most ...
const SLEW_SPAN_US: i64 = 100_000;
/// ... and closes the gap with this time constant.
const SLEW_SECONDS: f64 = 0.5;

/// This program's clock: never goes back, and counts from the Unix epoch as it was when the clock was made.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    anchor: Instant,
    unix_us: u64,
}

impl Clock {
    /// Anchors the clock at the system's time. A program makes one, at its start, and copies it: clocks made at
    /// different times differ by the corrections of the system's time in between.
    #[must_use]
    pub fn start() -> Self {
        let unix = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap_or_default();
        Self {
            anchor: Instant::now(),
            unix_us: micros(unix),
        }
    }

    /// The time now.
    #[must_use]
    pub fn now(&self) -> Micros {
        self.at(Instant::now())
    }

    /// The time at an instant of this process; the clock's start for any before it.
    #[must_use]
    pub fn at(&self, instant: Instant) -> Micros {
        Micros(
            self.unix_us
                .saturating_add(micros(instant.saturating_duration_since(self.anchor))),
        )
    }

    /// The instant of this process at a time of this clock; the clock's start for any before it.
    #[must_use]
    pub fn instant(&self, time: Micros) -> Instant {
        let since = Duration::from_micros(time.0.saturating_sub(self.unix_us));
        self.anchor.checked_add(since).unwrap_or(self.anchor)
    }
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}

/// The four times of one feedback and its pong, as NTP names them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exchange {
    /// t1: the viewer sent feedback, by the viewer's clock.
    pub sent: Micros,
    /// t2: it reached the sender, by the sender's clock.
    pub arrived: Micros,
    /// t3: the pong left, by the sender's clock.
    pub left: Micros,
    /// t4: the pong reached the viewer, by the viewer's clock.
    pub returned: Micros,
}

/// Why an exchange was refused. The estimate stays as it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExchangeError {
    /// A time is out of range.
    #[error("a time is beyond {} us", Micros::LATEST.0)]
    Range,
    /// The pong arrived before its feedback was sent, or was sent before its feedback arrived.
    #[error("a pong cannot come before its feedback")]
    Backwards,
    /// The sender claims to have held the feedback longer than the whole exchange took.
    #[error("the sender held the feedback for {held_us} us of an exchange that took {took_us} us")]
    Held {
        /// How long the sender says it held it.
        held_us: i64,
        /// How long the exchange took by the viewer's clock.
        took_us: i64,
    },
    /// The exchange took too long to be of use.
    #[error("the exchange took {took_us} us, more than {OLDEST_US} us")]
    Old {
        /// How long it took by the viewer's clock.
        took_us: i64,
    },
    /// Together with the exchanges before, a message would have arrived before it left.
    #[error("the times contradict the exchanges before them by {by_us} us")]
    Contradiction {
        /// By how much.
        by_us: i64,
    },
}

/// The least delays seen within one bucket of time, each with the unknown offset in it.
#[derive(Debug, Clone, Copy, Default)]
struct Bucket {
    slot: i64,
    /// Viewer to sender: true delay + offset, microseconds.
    forward: i64,
    /// Sender to viewer: true delay - offset.
    backward: i64,
}

/// Estimates the sender's clock minus the viewer's.
///
/// Every exchange bounds the offset from both sides: `arrived - sent` is at least it, `left - returned` at most. The least
/// delay of each direction over a sliding window gives the tightest bounds (Paxson 1998, section 4: minima are robust where
/// means are not), so that a spike one way never matters; the estimate is their middle. What is *used* follows the
/// estimate slowly, so that mapped times never go back between frames.
#[derive(Debug, Clone)]
pub struct ClockOffset {
    buckets: [Option<Bucket>; BUCKETS],
    /// The estimate: offset, and the least round trip it rests on.
    estimate: Option<(i64, i64)>,
    /// The offset in use, microseconds.
    used: f64,
    last_returned: i64,
    accepted: u32,
    contradictions: u32,
    restarts: u32,
}

impl Default for ClockOffset {
    fn default() -> Self {
        Self::new()
    }
}

impl ClockOffset {
    /// The most that one exchange moves the mapping once it is settled, microseconds: frames captured further apart
    /// than this stay in order when they are mapped with an exchange in between.
    pub const MAX_STEP_US: i64 = 5_000;

    /// Without an estimate.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            buckets: [None; BUCKETS],
            estimate: None,
            used: 0.0,
            last_returned: 0,
            accepted: 0,
            contradictions: 0,
            restarts: 0,
        }
    }

    /// Takes one exchange.
    ///
    /// # Errors
    /// If its times contradict each other or the exchanges before; then nothing has changed. After eight contradictions in a row the
    /// sender's clock counts as replaced ([`Self::restarts`]), and the estimate begins again.
    pub fn observe(&mut self, exchange: &Exchange) -> Result<(), ExchangeError> {
        let [sent, arrived, left, returned] = [
            exchange.sent,
            exchange.arrived,
            exchange.left,
            exchange.returned,
        ]
        .map(Micros::signed);
        if [arrived, left, returned].contains(&Micros::LATEST.signed()) {
            return Err(ExchangeError::Range);
        }
        let (took_us, held_us) = (returned - sent, left - arrived);
        if took_us < 0 || held_us < 0 {
            return Err(ExchangeError::Backwards);
        }
        if took_us > OLDEST_US {
            return Err(ExchangeError::Old { took_us });
        }
        if held_us > took_us + TOLERANCE_US {
            return Err(ExchangeError::Held { held_us, took_us });
        }
        let new = Bucket {
            slot: returned / BUCKET_US,
            forward: arrived - sent,
            backward: returned - left,
        };
        if let Some((forward, backward)) = self.least(new.slot) {
            let by_us = -(new.forward + backward).min(new.backward + forward);
            if by_us > TOLERANCE_US {
                self.contradictions += 1;
                if self.contradictions < CONTRADICTIONS {
                    return Err(ExchangeError::Contradiction { by_us });
                }
                let restarts = self.restarts + 1;
                *self = Self {
                    restarts,
                    ..Self::new()
                };
            }
        }
        self.contradictions = 0;
        self.keep(new);
        self.follow(new.slot, returned);
        Ok(())
    }

    fn keep(&mut self, new: Bucket) {
        let place = usize::try_from(new.slot).unwrap_or(0) % BUCKETS;
        let kept = &mut self.buckets[place];
        *kept = Some(match *kept {
            Some(old) if old.slot == new.slot => Bucket {
                slot: old.slot,
                forward: old.forward.min(new.forward),
                backward: old.backward.min(new.backward),
            },
            _ => new,
        });
    }

    /// The least delay of each direction over the window that ends with `slot`, an older one made worse by what the
    /// clocks may have drifted since.
    fn least(&self, slot: i64) -> Option<(i64, i64)> {
        self.buckets
            .iter()
            .flatten()
            .filter(|bucket| (0..BUCKETS as i64).contains(&(slot - bucket.slot)))
            .map(|bucket| {
                let drifted = (slot - bucket.slot) * BUCKET_US * DRIFT_PPM / 1_000_000;
                (bucket.forward + drifted, bucket.backward + drifted)
            })
            .reduce(|a, b| (a.0.min(b.0), a.1.min(b.1)))
    }

    fn follow(&mut self, slot: i64, returned: i64) {
        let Some((forward, backward)) = self.least(slot) else {
            return;
        };
        let offset = (forward - backward) / 2;
        self.estimate = Some((offset, (forward + backward).max(0)));
        let gap = offset as f64 - self.used;
        if self.accepted < ACQUIRING {
            self.used = offset as f64;
        } else {
            let span = (returned - self.last_returned).clamp(0, SLEW_SPAN_US) as f64;
            let most = SLEW * span;
            self.used += (gap * span / (SLEW_SECONDS * 1e6)).clamp(-most, most);
        }
        self.last_returned = self.last_returned.max(returned);
        self.accepted = self.accepted.saturating_add(1);
    }

    /// The sender's clock minus the viewer's as it is used now, microseconds; `None` before the first exchange.
    #[must_use]
    pub fn offset_us(&self) -> Option<i64> {
        self.estimate.map(|_| whole(self.used))
    }

    /// A time of the sender's clock by the viewer's; `None` before the first exchange.
    #[must_use]
    pub fn to_local(&self, sender: Micros) -> Option<Micros> {
        let offset = self.offset_us()?;
        Some(Micros(if offset < 0 {
            sender.0.saturating_add(offset.unsigned_abs())
        } else {
            sender.0.saturating_sub(offset.unsigned_abs())
        }))
    }

    /// The least round trip of the window, the sender's own delay left out.
    #[must_use]
    pub fn round_trip(&self) -> Option<Duration> {
        self.estimate
            .map(|(_, round_trip)| Duration::from_micros(round_trip.unsigned_abs()))
    }

    /// How far the offset in use may be off: half the round trip, were the whole of it spent one way, and what is still
    /// to be slewed.
    #[must_use]
    pub fn uncertainty(&self) -> Option<Duration> {
        self.estimate.map(|(offset, round_trip)| {
            let slewing = (offset - whole(self.used)).unsigned_abs();
            Duration::from_micros(round_trip.unsigned_abs().div_ceil(2) + slewing)
        })
    }

    /// How often the sender's clock was replaced.
    #[must_use]
    pub fn restarts(&self) -> u32 {
        self.restarts
    }
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "the cast saturates, and offsets are below 2^62"
)]
fn whole(value: f64) -> i64 {
    value.round() as i64
}

#[cfg(test)]
mod tests;
