//! When a device's samples are due. Programs get them, and are asked for them, in pieces that are late by turns; the device itself counts evenly.

use crate::RATE;
use std::time::{Duration, Instant};

/// The line through the pieces that were least late may rise by so much of the time that passes: no two clocks differ by more.
const RISE: f64 = 1e-3;
/// A piece that is later than this begins a new line: the device stood still.
const STOOD_STILL: f64 = 0.2;
/// Share of a new measurement of the device's delay.
const NEW: f64 = 0.25;
/// More than this is no delay of a device.
const LONGEST: f64 = 0.5;

/// A device's count of samples, as instants.
#[derive(Debug, Clone)]
pub(crate) struct DeviceClock {
    zero: Instant,
    /// When sample 0 was handed over, seconds after `zero`, and when that was last looked at.
    line: Option<(f64, f64)>,
    /// From the microphone to the program, or from the program to the loudspeaker, seconds.
    delay: Option<f64>,
}

impl DeviceClock {
    pub(crate) fn new() -> Self {
        Self {
            zero: Instant::now(),
            line: None,
            delay: None,
        }
    }

    /// At `now`, `count` samples had been handed over.
    pub(crate) fn observe(&mut self, count: u64, now: Instant) {
        let now = now.saturating_duration_since(self.zero).as_secs_f64();
        let seen = now - seconds(count);
        let line = match self.line {
            Some((line, at)) if seen <= line + STOOD_STILL => {
                seen.min(line + (now - at).max(0.0) * RISE)
            }
            _ => seen,
        };
        self.line = Some((line, now));
    }

    /// When sample `count` is handed over.
    pub(crate) fn at(&self, count: u64) -> Instant {
        let line = self.line.map_or(0.0, |(line, _)| line);
        let after = Duration::try_from_secs_f64(line + seconds(count));
        self.zero + after.unwrap_or_default()
    }

    /// At a microphone, sample `count` was in the air so many seconds before `now`.
    pub(crate) fn was_in_the_air(&mut self, count: u64, now: Instant, before: f64) {
        self.measured(before - signed_seconds(self.at(count), now));
    }

    /// At a loudspeaker, sample `count` will be in the air so many seconds after `now`.
    pub(crate) fn will_be_in_the_air(&mut self, count: u64, now: Instant, after: f64) {
        self.measured(after + signed_seconds(self.at(count), now));
    }

    fn measured(&mut self, delay: f64) {
        let delay = delay.clamp(0.0, LONGEST);
        self.delay = Some(match self.delay {
            Some(before) => before + (delay - before) * NEW,
            None => delay,
        });
    }

    /// Between the program and the air.
    pub(crate) fn delay(&self) -> Duration {
        Duration::from_secs_f64(self.delay.unwrap_or(0.0))
    }
}

fn seconds(count: u64) -> f64 {
    count as f64 / f64::from(RATE)
}

/// From `from` to `to`; negative where that is before.
fn signed_seconds(from: Instant, to: Instant) -> f64 {
    to.saturating_duration_since(from).as_secs_f64()
        - from.saturating_duration_since(to).as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(clock: &DeviceClock, ms: f64) -> Instant {
        clock.zero + Duration::from_secs_f64(ms / 1e3)
    }

    /// Milliseconds from `wanted` to where the clock has a sample.
    fn off(clock: &DeviceClock, count: u64, wanted_ms: f64) -> f64 {
        signed_seconds(after(clock, wanted_ms), clock.at(count)) * 1e3
    }

    #[test]
    fn pieces_that_are_late_by_turns_are_counted_evenly() {
        let mut clock = DeviceClock::new();
        for piece in 0..1_000u32 {
            let late = f64::from(piece % 7) * 3.0;
            let count = u64::from(piece) * 480;
            clock.observe(count, after(&clock, 50.0 + f64::from(piece) * 10.0 + late));
            if piece > 7 {
                let off = off(&clock, count, 50.0 + f64::from(piece) * 10.0);
                assert!((-0.01..0.3).contains(&off), "piece {piece}: {off} ms off");
            }
        }
    }

    #[test]
    fn a_device_whose_clock_is_slower_is_followed_and_one_that_stood_still_begins_anew() {
        let mut clock = DeviceClock::new();
        // Slower by 0.02 percent, for a hundred seconds.
        let at = |piece: u32| f64::from(piece) * 10.0 * 1.000_2;
        for piece in 0..10_000u32 {
            clock.observe(u64::from(piece) * 480, after(&clock, at(piece)));
        }
        let slow = off(&clock, 9_999 * 480, at(9_999));
        assert!(slow.abs() < 0.1, "{slow} ms off");
        clock.observe(10_000 * 480, after(&clock, 160_000.0));
        let still = off(&clock, 10_000 * 480, 160_000.0);
        assert!(still.abs() < 0.1, "{still} ms off");
    }

    #[test]
    fn the_devices_delay_is_from_the_line_to_the_air() {
        let mut clock = DeviceClock::new();
        clock.observe(0, after(&clock, 0.0));
        // 100 ms after the beginning, a sample of 80 ms after it will be heard in 45 ms.
        let now = after(&clock, 100.0);
        clock.will_be_in_the_air(80 * 48, now, 0.045);
        assert!(
            (clock.delay().as_secs_f64() - 0.065).abs() < 1e-4,
            "{clock:?}"
        );
        let mut clock = DeviceClock::new();
        clock.observe(0, after(&clock, 0.0));
        // And one of 90 ms after it was spoken 25 ms before, so 15 ms before it is handed over.
        clock.was_in_the_air(90 * 48, after(&clock, 100.0), 0.025);
        assert!(
            (clock.delay().as_secs_f64() - 0.015).abs() < 1e-4,
            "{clock:?}"
        );
    }
}
