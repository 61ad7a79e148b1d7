//! When pictures are shown: the display's vertical blanks, and which of them the next picture can reach.

use std::time::{Duration, Instant};

/// Share of a new picture's time in the expectation of the next.
const LEARNING: f64 = 0.2;

/// When a picture is to be shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// The vertical blank at which the picture that is begun now is expected to be shown.
    pub predicted: Instant,
    /// When the picture after it is expected to be begun ...
    pub next_begins: Instant,
    /// ... and the vertical blank at which it is expected to be shown.
    pub next: Instant,
    /// From one vertical blank to the next.
    pub period: Duration,
}

/// What is known of the picture after one that was just drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Next {
    /// When it is begun ...
    pub begins: Instant,
    /// ... and the vertical blank at which it is expected to be shown.
    pub displayed: Instant,
}

/// A display without hardware: vertical blanks at an even rate, for drawing offscreen and for windows, whose system does not say
/// when it shows a picture. OpenXR has its own.
#[derive(Debug, Clone)]
pub struct DisplayClock {
    start: Instant,
    period: Duration,
    /// Seconds from beginning a picture until it is drawn, as lately.
    drawing: f64,
    missed: u64,
    /// The blank at which the last picture was shown.
    shown: Option<u64>,
}

impl DisplayClock {
    /// A display of so many pictures a second, 1 to 1000.
    #[must_use]
    pub fn new(hertz: f64) -> Self {
        Self {
            start: Instant::now(),
            period: Duration::from_secs_f64(hertz.clamp(1.0, 1000.0).recip()),
            drawing: 0.0,
            missed: 0,
            shown: None,
        }
    }

    /// From one vertical blank to the next.
    #[must_use]
    pub fn period(&self) -> Duration {
        self.period
    }

    /// Vertical blanks since the first picture at which no new picture was there.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// Sleeps until the next picture is to be begun: at the vertical blank at which the last one is shown, since there is room
    /// for one only.
    pub fn wait(&self) {
        if let Some(shown) = self.shown {
            let pause = self.blank(shown).saturating_duration_since(Instant::now());
            if !pause.is_zero() {
                std::thread::sleep(pause);
            }
        }
    }

    /// Which vertical blanks the picture that is begun at `now`, and the one after it, can reach.
    #[must_use]
    pub fn tick(&self, now: Instant) -> Tick {
        let drawing = Duration::from_secs_f64(self.drawing);
        let first = self.index_at_or_after(now + drawing).max(self.free());
        let predicted = self.blank(first);
        // A picture is begun when the one before is shown.
        let next = self.index_at_or_after(predicted + drawing).max(first + 1);
        Tick {
            predicted,
            next_begins: predicted,
            next: self.blank(next),
            period: self.period,
        }
    }

    /// A picture that was begun at `begun` is drawn at `drawn`: returns the vertical blank at which it is shown, and counts those
    /// that went by without one.
    pub fn drawn(&mut self, begun: Instant, drawn: Instant) -> Instant {
        let took = drawn.saturating_duration_since(begun).as_secs_f64();
        self.drawing = if self.shown.is_none() {
            took
        } else {
            self.drawing + (took - self.drawing) * LEARNING
        };
        let mut at = self.index_at_or_after(drawn).max(self.free());
        // A display that is faster than it is taken for shows pictures sooner: blanks are moved there.
        let ahead = self
            .blank(at)
            .saturating_duration_since(drawn + self.period);
        if !ahead.is_zero() {
            self.start = self.start.checked_sub(ahead).unwrap_or(self.start);
            at = at.max(self.free());
        }
        if let Some(shown) = self.shown {
            self.missed += at - shown - 1;
        }
        self.shown = Some(at);
        self.blank(at)
    }

    /// The first vertical blank without a picture.
    fn free(&self) -> u64 {
        self.shown.map_or(0, |shown| shown + 1)
    }

    fn index_at_or_after(&self, at: Instant) -> u64 {
        let passed = at.saturating_duration_since(self.start).as_nanos();
        u64::try_from(passed.div_ceil(self.period.as_nanos().max(1))).unwrap_or(u64::MAX)
    }

    fn blank(&self, index: u64) -> Instant {
        let nanoseconds = self.period.as_nanos() * u128::from(index);
        self.start + Duration::from_nanos(u64::try_from(nanoseconds).unwrap_or(u64::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_renderer_is_shown_at_every_blank_and_predicted_exactly() {
        let mut display = DisplayClock::new(100.0);
        let mut now = display.start;
        for picture in 0..100u32 {
            let tick = display.tick(now);
            let shown = display.drawn(now, now + Duration::from_millis(4));
            assert!(picture < 2 || shown == tick.predicted, "picture {picture}");
            assert!(
                picture < 2 || tick.next == tick.predicted + display.period(),
                "next"
            );
            now = shown;
        }
        assert_eq!(display.missed(), 0, "blanks without a picture");
    }

    #[test]
    fn a_display_that_is_faster_than_it_was_taken_for_does_not_run_away() {
        let mut display = DisplayClock::new(60.0);
        let mut now = display.start;
        for picture in 0..1200u32 {
            let tick = display.tick(now);
            let ahead = tick.predicted.saturating_duration_since(now);
            assert!(
                ahead <= 2 * display.period(),
                "picture {picture}: {ahead:?}"
            );
            now += Duration::from_micros(8_333);
            display.drawn(now - Duration::from_millis(2), now);
        }
    }

    #[test]
    fn a_slow_renderer_misses_blanks_which_are_counted_and_foreseen() {
        let mut display = DisplayClock::new(100.0);
        let mut now = display.start;
        for picture in 0..100u32 {
            let tick = display.tick(now);
            let shown = display.drawn(now, now + Duration::from_millis(25));
            assert!(picture < 2 || shown == tick.predicted, "picture {picture}");
            assert!(
                picture < 2 || tick.next == tick.predicted + 3 * display.period(),
                "next"
            );
            now = shown;
        }
        // Every picture takes three blanks; the first has none before it.
        assert_eq!(display.missed(), 2 * 99, "blanks without a picture");
    }
}
