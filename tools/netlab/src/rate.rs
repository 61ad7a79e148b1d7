//! A link's rate: steady, or by a bandwidth trace. All arithmetic is in whole numbers, so that a replay is exact.

use std::{fmt, sync::Arc, time::Duration};

use crate::units::{NANOS_PER_SECOND, from_nanos, whole_bits};
use crate::{NetlabError, Trace};

/// A steady rate in bit/s, never zero (for that there are outages and traces).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BitRate(u64);

impl BitRate {
    /// A rate in kbit/s (1000 bit/s), from 0.001 to 10^9.
    ///
    /// # Errors
    /// [`NetlabError::OutOfRange`].
    pub fn from_kbit_s(kbit_s: f64) -> Result<Self, NetlabError> {
        whole_bits(kbit_s)
            .filter(|&bits| bits > 0)
            .map(Self)
            .ok_or(NetlabError::OutOfRange {
                what: "a rate in kbit/s",
                value: kbit_s,
                expected: "between 0.001 and 1e9",
            })
    }

    /// In bit/s.
    pub fn bits_per_second(self) -> u64 {
        self.0
    }

    /// How long so many bytes take, rounded up to the nanosecond.
    pub fn time_for(self, bytes: u64) -> Duration {
        from_nanos((u128::from(bytes) * 8 * NANOS_PER_SECOND).div_ceil(u128::from(self.0)))
    }
}

impl fmt::Display for BitRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} kbit/s", self.0 as f64 / 1000.0)
    }
}

/// The rate at which a link sends packets.
#[derive(Debug, Clone, PartialEq)]
pub enum Rate {
    /// Always the same.
    Steady(BitRate),
    /// As the trace says, over and over. Its time 0 is when the impairment is put in place.
    Trace(Arc<Trace>),
}

impl Rate {
    /// When a packet of so many bytes whose transmission begins at `start` has left. Times are since the rate was put in place.
    pub fn finish(&self, start: Duration, bytes: u64) -> Duration {
        match self {
            Self::Steady(rate) => start.saturating_add(rate.time_for(bytes)),
            Self::Trace(trace) => trace.finish(start, bytes),
        }
    }
}

impl fmt::Display for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Steady(rate) => rate.fmt(f),
            Self::Trace(trace) => write!(f, "trace {}", trace.name()),
        }
    }
}
