//! Values of the file of limits: each in its range, and told in words where it is not.

use serde::de::{Deserializer, Error, Unexpected, Visitor};
use std::fmt;
use std::marker::PhantomData;
use std::time::Duration;

/// Reads a whole number from `LEAST` to `MOST`.
pub(crate) fn whole<'de, const LEAST: u64, const MOST: u64, T, D>(from: D) -> Result<T, D::Error>
where
    T: TryFrom<u64>,
    D: Deserializer<'de>,
{
    from.deserialize_i64(Whole::<LEAST, MOST, T>(PhantomData))
}

/// Reads a number of seconds, from `LEAST_MS` milliseconds to `MOST` seconds.
pub(crate) fn seconds<'de, const LEAST_MS: u64, const MOST: u64, D>(
    from: D,
) -> Result<Duration, D::Error>
where
    D: Deserializer<'de>,
{
    from.deserialize_f64(Seconds {
        least: Duration::from_millis(LEAST_MS),
        most: Duration::from_secs(MOST),
    })
}

struct Whole<const LEAST: u64, const MOST: u64, T>(PhantomData<T>);

impl<const LEAST: u64, const MOST: u64, T: TryFrom<u64>> Visitor<'_> for Whole<LEAST, MOST, T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a whole number from {LEAST} to {MOST}")
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<T, E> {
        let in_range = u64::try_from(value).ok();
        let in_range = in_range.filter(|value| (LEAST..=MOST).contains(value));
        in_range
            .and_then(|value| T::try_from(value).ok())
            .ok_or_else(|| E::invalid_value(Unexpected::Signed(value), &self))
    }
}

struct Seconds {
    least: Duration,
    most: Duration,
}

impl Visitor<'_> for Seconds {
    type Value = Duration;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (least, most) = (self.least.as_secs_f64(), self.most.as_secs());
        write!(f, "a number of seconds from {least} to {most}")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Duration, E> {
        Duration::try_from_secs_f64(value)
            .ok()
            .filter(|time| (self.least..=self.most).contains(time))
            .ok_or_else(|| E::invalid_value(Unexpected::Float(value), &self))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Duration, E> {
        u64::try_from(value)
            .ok()
            .map(Duration::from_secs)
            .filter(|time| (self.least..=self.most).contains(time))
            .ok_or_else(|| E::invalid_value(Unexpected::Signed(value), &self))
    }
}
