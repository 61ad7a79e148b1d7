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
/// A microphone's delay that is measured below zero by more than this, seconds, is no noise: samples were lost on their way.
const NOISE: f64 = 0.01;

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
    ///
    /// After a loss of samples the line is early by their length, and would rise to its place at [`RISE`]. No sample is handed over before
    /// it was in the air: a measurement below zero shows the loss, and moves the line so that the last known delay holds again.
    pub(crate) fn was_in_the_air(&mut self, count: u64, now: Instant, before: f64) {
        let delay = before - signed_seconds(self.at(count), now);
        if delay >= -NOISE {
            self.measured(delay);
        } else if let Some((line, _)) = &mut self.line {
            *line += self.delay.unwrap_or(0.0) - delay;
        }
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

    /// A microphone by a script: pieces of 10 ms, 25 ms after they were in the air and up to 6 ms late, and a measurement every second.
    struct Script {
        clock: DeviceClock,
        /// Pieces that the device has captured, and samples that were handed over.
        captured: u32,
        count: u64,
        answers: bool,
    }

    impl Script {
        const DELAY_MS: f64 = 25.0;

        /// After ten seconds in which nothing was lost.
        fn begun() -> Self {
            let mut script = Self {
                clock: DeviceClock::new(),
                captured: 0,
                count: 0,
                answers: true,
            };
            script.pieces(1_050);
            let off = script.off();
            assert!(off.abs() < 2.0, "{off} ms off before any loss");
            script
        }

        fn captured_ms(&self) -> f64 {
            f64::from(self.captured) * 10.0
        }

        /// The next piece, or its loss.
        fn piece(&mut self, lost: bool) {
            self.captured += 1;
            if lost {
                return;
            }
            self.count += 480;
            let handed = self.captured_ms() + Self::DELAY_MS;
            let late = f64::from(self.captured % 4) * 2.0;
            let now = after(&self.clock, handed + late);
            self.clock.observe(self.count, now);
            if self.captured.is_multiple_of(100) && self.answers {
                self.clock
                    .was_in_the_air(self.count, now, (Self::DELAY_MS + late) / 1e3);
            }
        }

        fn pieces(&mut self, number: u32) {
            for _ in 0..number {
                self.piece(false);
            }
        }

        /// Milliseconds by which the last sample's time in the air is late.
        fn off(&self) -> f64 {
            let off = off(&self.clock, self.count, self.captured_ms());
            off - self.clock.delay().as_secs_f64() * 1e3
        }
    }

    #[test]
    fn samples_that_were_lost_move_the_line_with_the_next_measurement() {
        // More than the delay, so that the measurement is below zero.
        for lost in [5, 15] {
            let mut script = Script::begun();
            let delay = script.clock.delay();
            for _ in 0..lost {
                script.piece(true);
            }
            script.pieces(90);
            let off = script.off();
            assert!(off.abs() < 2.0, "{off} ms off after {lost} pieces");
            assert_eq!(script.clock.delay(), delay, "the last known");
        }
        // Less than the delay is measured as a shorter one.
        let mut script = Script::begun();
        script.piece(true);
        script.pieces(2_000);
        let off = script.off();
        assert!(off.abs() < 2.0, "{off} ms off after one piece");
    }

    #[test]
    fn the_last_known_delay_is_kept_where_no_measurement_is_answered() {
        let mut script = Script::begun();
        let delay = script.clock.delay();
        assert!(delay.as_secs_f64() > 0.015, "{delay:?}");
        script.answers = false;
        // So many that the line begins anew.
        for _ in 0..30 {
            script.piece(true);
        }
        script.pieces(500);
        assert_eq!(script.clock.delay(), delay, "without an answer");
        let off = script.off();
        assert!(off.abs() < 2.0, "{off} ms off");
    }

    #[test]
    fn a_measurement_that_is_late_itself_spoils_nothing_for_long() {
        let mut script = Script::begun();
        let delay = script.clock.delay();
        // The answer was read 60 ms after it was given.
        let now = after(
            &script.clock,
            script.captured_ms() + Script::DELAY_MS + 60.0,
        );
        script
            .clock
            .was_in_the_air(script.count, now, Script::DELAY_MS / 1e3);
        script.pieces(4);
        assert_eq!(script.clock.delay(), delay, "the last known");
        let off = script.off();
        assert!(off.abs() < 2.0, "{off} ms off");
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
