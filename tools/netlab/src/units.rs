//! Rates and times in whole numbers.

use std::time::Duration;

pub(crate) const NANOS_PER_SECOND: u128 = 1_000_000_000;

/// kbit/s as whole bit/s; `None` if it is no rate.
pub(crate) fn whole_bits(kbit_s: f64) -> Option<u64> {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "the range is checked first: at most 10^12"
    )]
    (0.0..=1e9)
        .contains(&kbit_s)
        .then(|| (kbit_s * 1000.0).round() as u64)
}

pub(crate) fn from_nanos(nanos: u128) -> Duration {
    Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
}
