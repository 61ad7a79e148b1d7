//! A headset's pace: when the frame that is begun now will be seen, when the next one begins and is seen, and which came late.

use app_pipeline::lanes::{Next, Tick};
use renderer_openxr::frame::Frame;
use std::time::{Duration, Instant};

/// Share of a new interval in the expectation of the next.
const LEARNING: f64 = 0.2;

/// Share of what a frame was begun later than others that is taken for a new habit.
const FORGETTING: f64 = 0.05;

/// What is remembered of the frames before.
#[derive(Debug, Clone)]
pub(super) struct Pace {
    /// The display's own period, where it is known: what the runtime predicts grows while frames are late.
    display: Option<Duration>,
    /// Seconds from one frame's beginning to the next one's.
    interval: Option<f64>,
    /// How long before it is seen a frame is begun, at most: one that is begun late says nothing about the next.
    ahead: Duration,
    begun: Option<Instant>,
    seen: Option<Instant>,
    late: u64,
}

impl Pace {
    /// Of a display of so many Hz, if that is known.
    pub(super) fn new(display_hz: Option<f32>) -> Self {
        let known = display_hz.filter(|hz| (1.0..=1000.0).contains(hz));
        Self {
            display: known.map(|hz| Duration::from_secs_f32(1.0 / hz)),
            interval: None,
            ahead: Duration::ZERO,
            begun: None,
            seen: None,
            late: 0,
        }
    }

    /// Refreshes of the display that showed nothing new since the first frame.
    pub(super) fn late(&self) -> u64 {
        self.late
    }

    /// The time between two refreshes of the display.
    pub(super) fn period(&self, frame: &Frame) -> Duration {
        self.display.unwrap_or(frame.period)
    }

    /// A frame is begun at `begun`.
    pub(super) fn tick(&mut self, frame: &Frame, begun: Instant) -> Tick {
        let period = self.period(frame);
        if let Some(last) = self.begun.replace(begun) {
            // What came between sessions says nothing of frames.
            let passed = begun.saturating_duration_since(last).as_secs_f64().min(1.0);
            let known = self.interval.unwrap_or(passed);
            self.interval = Some(known + (passed - known) * LEARNING);
        }
        let ahead = frame.predicted.saturating_duration_since(begun);
        self.ahead = ahead.max(self.ahead.mul_f64(1.0 - FORGETTING) + ahead.mul_f64(FORGETTING));
        let expected = self.interval.map_or(period, Duration::from_secs_f64);
        let next = self.after(frame, period * in_periods(expected, period).max(1));
        Tick {
            predicted: frame.predicted,
            next_begins: next.begins,
            next: next.displayed,
            period,
        }
    }

    /// The frame that follows one which was begun at `begun` and handed over at `shown`: the runtime begins the next one as soon as
    /// it can, a whole number of the display's periods later, but no sooner than it says.
    pub(super) fn next(&self, frame: &Frame, begun: Instant, shown: Instant) -> Next {
        let period = self.period(frame);
        let took = shown.saturating_duration_since(begun).as_nanos();
        let periods = took.div_ceil(period.as_nanos().max(1)).clamp(1, 10_000);
        let periods = u32::try_from(periods).unwrap_or(1);
        self.after(frame, (period * periods).max(frame.period))
    }

    fn after(&self, frame: &Frame, interval: Duration) -> Next {
        let displayed = frame.predicted + interval;
        Next {
            begins: displayed.checked_sub(self.ahead).unwrap_or(displayed),
            displayed,
        }
    }

    /// The frame was handed over at `shown`: when it is seen, and whether that is when it was to be.
    pub(super) fn shown(&mut self, frame: &Frame, shown: Instant) -> (Instant, bool) {
        let period = self.period(frame);
        let missed = match shown.checked_duration_since(frame.predicted) {
            None => 0,
            Some(behind) => in_periods(behind, period) + 1,
        };
        let seen = frame.predicted + period * missed;
        let gap = self.seen.map_or(1, |last| {
            in_periods(seen.saturating_duration_since(last), period)
        });
        self.late += u64::from(gap.saturating_sub(1));
        self.seen = Some(seen);
        (seen, missed == 0 && gap <= 1)
    }

    /// There are no frames for a while: none of them is late.
    pub(super) fn pause(&mut self) {
        (self.begun, self.seen) = (None, None);
        self.ahead = Duration::ZERO;
    }
}

/// How many periods a time is, to the nearest.
fn in_periods(time: Duration, period: Duration) -> u32 {
    let ratio = time.as_secs_f64() / period.as_secs_f64().max(1e-6);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive, and held at the type's end"
    )]
    let whole = ratio.round() as u32;
    whole.min(10_000)
}
