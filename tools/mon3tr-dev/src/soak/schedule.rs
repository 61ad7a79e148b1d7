//! When what happens in a call of so many minutes.

use std::ops::Range;
use std::time::Duration;

/// Until buffers have found their size, clocks are compared and caches are warm.
const WARM_UP: Duration = Duration::from_mins(1);

/// What is compared: the first so many minutes after the warm-up with the last.
const WINDOW: Duration = Duration::from_mins(5);

/// How long the headset's runtime is away at a restart.
const AWAY: Duration = Duration::from_secs(4);

/// Of a call that is too short for them, warm-up, each window and each absence are these parts ...
const PARTS: (u32, u32, u32) = (6, 4, 20);

/// ... and of what comes after its last restart.
const LATE_PARTS: u32 = 3;

/// Times since the call was live.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Schedule {
    /// When it ends.
    pub(super) length: Duration,
    /// What is compared ...
    pub(super) first: Range<Duration>,
    /// ... with what.
    pub(super) last: Range<Duration>,
    /// When the headset's runtime is killed: between the two.
    pub(super) restarts: [Duration; 2],
    /// How long it is away then.
    pub(super) away: Duration,
    /// The same two windows of what comes after the last restart: a restart gives memory back, which would hide what grows.
    pub(super) late: [Range<Duration>; 2],
}

impl Schedule {
    /// Of a call of this length.
    pub(super) fn of(length: Duration) -> Self {
        let warm_up = WARM_UP.min(length / PARTS.0);
        let window = WINDOW.min(length / PARTS.1);
        let first = warm_up..warm_up + window;
        let last = length.saturating_sub(window)..length;
        let between = last.start.saturating_sub(first.end);
        let restarts = [first.end + between / 3, first.end + between * 2 / 3];
        let away = AWAY.min(length / PARTS.2);
        let back = restarts[1] + away;
        let part = length.saturating_sub(back) / LATE_PARTS;
        let settled = back + WARM_UP.min(part);
        let late = WINDOW.min(part);
        Self {
            length,
            restarts,
            away,
            first,
            last,
            late: [settled..settled + late, length.saturating_sub(late)..length],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn minutes(minutes: u64) -> Duration {
        Duration::from_mins(minutes)
    }

    #[test]
    fn an_hour_has_whole_windows() {
        let hour = Schedule::of(minutes(60));
        assert_eq!(hour.first, minutes(1)..minutes(6), "after a minute");
        assert_eq!(hour.last, minutes(55)..minutes(60), "at the end");
    }

    #[test]
    fn what_is_short_has_short_windows_that_restarts_lie_between() {
        for seconds in [30, 120, 300, 1000, 3600] {
            let one = Schedule::of(Duration::from_secs(seconds));
            let [a, b] = one.restarts;
            assert!(one.first.start > Duration::ZERO, "a warm-up: {one:?}");
            assert!(one.first.end < a, "{one:?}");
            assert!(a < b, "{one:?}");
            assert!(b < one.last.start, "{one:?}");
            assert_eq!(one.last.end, one.length, "{one:?}");
            let window = |range: &Range<Duration>| range.end - range.start;
            assert_eq!(window(&one.first), window(&one.last), "{one:?}");
            let [early, late] = &one.late;
            assert!(a + one.away < b, "back in between: {one:?}");
            assert!(b + one.away < early.start, "{one:?}");
            assert!(early.end <= late.start, "{one:?}");
            assert_eq!(late.end, one.length, "{one:?}");
            assert_eq!(window(early), window(late), "{one:?}");
            assert!(window(late) > Duration::from_secs(2), "a sample: {one:?}");
        }
    }
}
