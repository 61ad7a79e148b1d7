//! The controller: when quality falls, when it comes back.

use super::figures::Counters;
use super::recent::Recent;
use super::{Change, LADDER, PictureCost, Quality, QualityFigures, QualityMode, Reason};
use std::time::Duration;

/// A picture that takes more of the period than this is too slow: the compositor wants some of it, too.
const OVER: f64 = 0.95;
/// Quality falls to the first step that is predicted to take no more of the period than this.
const GOAL: f64 = 0.85;
/// Quality rises only to a step that is predicted to take no more of the period than this.
const CLIMB: f64 = 0.8;
/// A picture that was late although it took less of the period than this was not late for its work on the GPU.
const BLAMELESS: f64 = 0.6;

/// Of the last so many pictures ...
const JUDGED: u32 = 8;
/// ... so many must be too slow before quality falls: fewer are outliers.
const TOO_MANY: u32 = 4;
/// Pictures of the present step that a climb's prediction needs.
const ENOUGH: usize = 32;

/// Calm before the first climb, ms, and the longest that failed climbs lead to.
const FIRST_WAIT: f64 = 2_000.0;
const LONGEST_WAIT: f64 = 64_000.0;
/// A fall within this time after a climb says that the climb failed, ms.
const TRIAL: f64 = 30_000.0;
/// Each time as long without a fall halves the wait again, ms: longer than two waits that a swinging load has led to.
const RELAXED: f64 = 60_000.0;

/// Climbs in any minute, whatever the times.
const CLIMBS_A_MINUTE: usize = 8;
const MINUTE: f64 = 60_000.0;
/// Changes of quality in any minute, whatever the times: every fall takes a climb before it, or a step that was there at
/// the minute's start.
pub const MOST_CHANGES_A_MINUTE: usize = 2 * CLIMBS_A_MINUTE + LADDER.len() - 1;

/// Holds the display's rate.
#[derive(Debug)]
pub struct QualityController {
    mode: QualityMode,
    period_ms: f64,
    step: usize,
    recent: Recent,
    /// One bit a picture, the newest lowest: too slow?
    slow: u32,
    /// Time since the start, since the last disturbance, fall and climb, ms.
    now: f64,
    calm: f64,
    since_fall: f64,
    since_climb: f64,
    climb_wait: f64,
    /// When the last climbs were, oldest overwritten first.
    climbs: [f64; CLIMBS_A_MINUTE],
    next_climb: usize,
    counters: Counters,
}

impl QualityController {
    /// A controller for a display that shows a picture every `period` (at least 1 ms is taken). It begins at the best step,
    /// or at the fixed one.
    #[must_use]
    pub fn new(period: Duration, mode: QualityMode) -> Self {
        let step = match mode {
            QualityMode::Adapt => 0,
            QualityMode::Fixed(step) => Quality::of_step(step).step,
        };
        Self {
            mode,
            period_ms: milliseconds(period),
            step,
            recent: Recent::new(),
            slow: 0,
            now: 0.0,
            calm: 0.0,
            since_fall: 0.0,
            since_climb: f64::INFINITY,
            climb_wait: FIRST_WAIT,
            climbs: [f64::NEG_INFINITY; CLIMBS_A_MINUTE],
            next_climb: 0,
            counters: Counters::new(),
        }
    }

    /// The same, told before the first picture that one at the best step takes the GPU so long: it begins where that is predicted to fit, as if all of it
    /// followed the pixels, so at a step rather too good. What then is measured decides.
    #[must_use]
    pub fn expecting(mut self, picture: Option<Duration>) -> Self {
        if let (QualityMode::Adapt, Some(picture)) = (self.mode, picture) {
            let mut expected = Recent::new();
            expected.push(PictureCost {
                pixels_ms: picture.as_secs_f64() * 1e3,
                ..PictureCost::default()
            });
            let best = Quality::of_step(0);
            let holds = |step: &usize| {
                let at = Quality::of_step(*step);
                expected.predicted(best, at, 1, 100) <= GOAL * self.period_ms
            };
            let last = LADDER.len() - 1;
            self.step = (0..last).find(holds).unwrap_or(last);
        }
        self
    }

    /// What to draw the next picture with.
    #[must_use]
    pub fn quality(&self) -> Quality {
        Quality::of_step(self.step)
    }

    /// The display changed its rate: judged anew, at the same step.
    pub fn set_period(&mut self, period: Duration) {
        let period_ms = milliseconds(period);
        if period_ms.to_bits() != self.period_ms.to_bits() {
            self.period_ms = period_ms;
            self.begin_step();
        }
    }

    /// The display showed a picture once more because there was nothing new to draw: time passes, no one was late.
    pub fn repeated(&mut self) {
        self.counters.repeated_periods += 1;
        self.pass(1.0, self.step);
    }

    /// Takes note of a picture that was shown and answers the quality of the next one.
    pub fn picture(&mut self, cost: &PictureCost) -> Quality {
        let cost = cost.sane();
        let periods = 1.0 + f64::from(cost.late_periods);
        self.pass(periods, cost.step);
        let total = cost.total_ms();
        let late = cost.late_periods > 0;
        let blameless = total > 0.0 && total <= BLAMELESS * self.period_ms;
        let counters = &mut self.counters;
        counters.pictures += 1;
        if let Some((_, pictures)) = counters.steps.get_mut(cost.step) {
            *pictures += 1;
        }
        if late {
            counters.late_pictures += 1;
            counters.missed_periods += u64::from(cost.late_periods);
            if blameless {
                counters.missed_elsewhere += u64::from(cost.late_periods);
            }
        }
        // A picture that was in flight while quality changed says nothing about the new one.
        if cost.step != self.step {
            return self.quality();
        }
        let slow = total > OVER * self.period_ms || (late && !blameless);
        self.recent.push(cost);
        self.slow = (self.slow << 1 | u32::from(slow)) & ((1 << JUDGED) - 1);
        let last_step = self.step + 1 == LADDER.len();
        if slow && last_step {
            self.counters.overloaded_at_last_step += 1;
        }
        let slow_ones = self.slow.count_ones();
        if slow_ones > 1 {
            self.calm = 0.0;
        }
        if self.mode == QualityMode::Adapt {
            if slow_ones >= TOO_MANY && !last_step {
                self.fall();
            } else if self.calm >= self.climb_wait && self.step > 0 {
                self.try_climb();
            }
        }
        self.quality()
    }

    /// The last change of quality, for a line in the log when [`Self::picture`] answers another quality than before.
    #[must_use]
    pub fn last_change(&self) -> Option<Change> {
        self.counters.last_change()
    }

    /// How the rate was held so far. Allocates: not for every picture.
    #[must_use]
    pub fn figures(&self) -> QualityFigures {
        self.counters
            .figures(self.mode, self.quality(), self.period_ms, self.climb_wait)
    }

    /// Time passes with a picture of `step` in view.
    fn pass(&mut self, periods: f64, step: usize) {
        let ms = periods * self.period_ms;
        for clock in [
            &mut self.now,
            &mut self.calm,
            &mut self.since_fall,
            &mut self.since_climb,
        ] {
            *clock += ms;
        }
        if let Some((spent, _)) = self.counters.steps.get_mut(step) {
            *spent += ms;
        }
        if self.since_fall >= RELAXED {
            self.since_fall -= RELAXED;
            self.climb_wait = (self.climb_wait / 2.0).max(FIRST_WAIT);
        }
    }

    /// To the first step that is predicted to hold, or the last.
    fn fall(&mut self) {
        let with = self.quality();
        let judged = JUDGED as usize;
        let predict = |at: Quality| self.recent.predicted(with, at, judged, 75) / self.period_ms;
        let last = LADDER.len() - 1;
        // Without a clock nothing can be predicted: one step, and see.
        let holds =
            |step: &usize| !self.recent.has_times() || predict(Quality::of_step(*step)) <= GOAL;
        let to = (self.step + 1..last).find(holds).unwrap_or(last);
        let reason = Reason::Overload {
            load: predict(with),
            predicted_load: predict(Quality::of_step(to)),
        };
        if self.since_climb < TRIAL {
            self.climb_wait = (self.climb_wait * 2.0).min(LONGEST_WAIT);
            self.counters.failed_climbs += 1;
            // One failure is counted once.
            self.since_climb = f64::INFINITY;
        }
        self.since_fall = 0.0;
        self.change(to, reason);
    }

    fn try_climb(&mut self) {
        let to = self.step - 1;
        let (with, at) = (self.quality(), Quality::of_step(to));
        let oldest = self.climbs[self.next_climb];
        if self.recent.len() < ENOUGH || self.now - oldest < MINUTE {
            return;
        }
        let predict =
            |at| self.recent.predicted(with, at, super::recent::CAPACITY, 90) / self.period_ms;
        let predicted_load = predict(at);
        // All but one of the 64 must be in time there: with times that scatter, the limit lies lower.
        let rank = super::recent::CAPACITY;
        let nearly_all = self.recent.predicted(with, at, rank, 98) / self.period_ms;
        if predicted_load > CLIMB || nearly_all > OVER {
            return;
        }
        let reason = Reason::Relief {
            load: predict(with),
            predicted_load,
        };
        self.climbs[self.next_climb] = self.now;
        self.next_climb = (self.next_climb + 1) % CLIMBS_A_MINUTE;
        self.since_climb = 0.0;
        self.change(to, reason);
    }

    fn change(&mut self, to: usize, reason: Reason) {
        self.counters.changed(Change {
            at_seconds: self.now / 1e3,
            from_step: self.step,
            to_step: to,
            reason,
        });
        self.step = to;
        self.begin_step();
    }

    fn begin_step(&mut self) {
        self.recent.clear();
        self.slow = 0;
        self.calm = 0.0;
    }
}

fn milliseconds(period: Duration) -> f64 {
    (period.as_secs_f64() * 1e3).max(1.0)
}
