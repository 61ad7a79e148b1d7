//! What holding the rate cost: nothing is missed silently.

use super::{LADDER, Quality, QualityMode};
use serde::Serialize;
use std::collections::VecDeque;

/// Changes that are remembered one by one; all are counted.
const REMEMBERED: usize = 64;

/// Why the quality changed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "why", rename_all = "snake_case")]
pub enum Reason {
    /// Several pictures in short order took too long or came late.
    Overload {
        /// Upper quartile of the last eight pictures' GPU times, in display periods; 0 where the device has no clock.
        load: f64,
        /// The same as predicted for the new step.
        predicted_load: f64,
    },
    /// Calm for long enough, and the better step is predicted to hold.
    Relief {
        /// 90th percentile of the last pictures' GPU times, in display periods.
        load: f64,
        /// The same as predicted for the new step.
        predicted_load: f64,
    },
}

/// One change of quality.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Change {
    /// Seconds since the start, as display periods passed.
    pub at_seconds: f64,
    /// The step before.
    pub from_step: usize,
    /// The step after.
    pub to_step: usize,
    /// Why.
    pub reason: Reason,
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (verb, load, predicted_load) = match self.reason {
            Reason::Overload {
                load,
                predicted_load,
            } => ("falls", load, predicted_load),
            Reason::Relief {
                load,
                predicted_load,
            } => ("rises", load, predicted_load),
        };
        write!(
            f,
            "{:.1} s: quality {verb} from step {} to {} ({}): pictures take {:.0} % of the period, {:.0} % expected then",
            self.at_seconds,
            self.from_step,
            self.to_step,
            Quality::of_step(self.to_step),
            100.0 * load,
            100.0 * predicted_load
        )
    }
}

/// How much was drawn at one step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepFigures {
    /// The step.
    pub quality: Quality,
    /// The share of the Gaussians that it draws.
    pub kept_share: f32,
    /// Time spent on it, seconds.
    pub seconds: f64,
    /// Pictures drawn with it.
    pub pictures: u64,
}

/// How the rate was held so far.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QualityFigures {
    /// Whether quality may change.
    pub mode: QualityMode,
    /// The quality of the next picture.
    pub quality: Quality,
    /// Display period, ms.
    pub period_ms: f64,
    /// Pictures drawn.
    pub pictures: u64,
    /// Pictures that were not ready for the period they were drawn for.
    pub late_pictures: u64,
    /// Display periods without a new picture because it was late.
    pub missed_periods: u64,
    /// Those of them that less work on the GPU would not have saved: its time was well within the period.
    pub missed_elsewhere: u64,
    /// Display periods without a new picture because there was nothing new to draw.
    pub repeated_periods: u64,
    /// Pictures that took too long though the last step was drawn: quality has nothing left to give.
    pub overloaded_at_last_step: u64,
    /// Changes of quality, all of them.
    pub change_count: u64,
    /// Climbs that had to be taken back within half a minute.
    pub failed_climbs: u64,
    /// Calm that the next climb takes, seconds.
    pub climb_wait_seconds: f64,
    /// Time and pictures by step, the best first.
    pub steps: Vec<StepFigures>,
    /// The last changes, oldest first.
    pub changes: Vec<Change>,
}

/// The counters behind [`QualityFigures`], of fixed size.
#[derive(Debug)]
pub(super) struct Counters {
    pub(super) pictures: u64,
    pub(super) late_pictures: u64,
    pub(super) missed_periods: u64,
    pub(super) missed_elsewhere: u64,
    pub(super) repeated_periods: u64,
    pub(super) overloaded_at_last_step: u64,
    pub(super) change_count: u64,
    pub(super) failed_climbs: u64,
    /// Milliseconds and pictures by step.
    pub(super) steps: [(f64, u64); LADDER.len()],
    changes: VecDeque<Change>,
}

impl Counters {
    pub(super) fn new() -> Self {
        Self {
            pictures: 0,
            late_pictures: 0,
            missed_periods: 0,
            missed_elsewhere: 0,
            repeated_periods: 0,
            overloaded_at_last_step: 0,
            change_count: 0,
            failed_climbs: 0,
            steps: [(0.0, 0); LADDER.len()],
            changes: VecDeque::with_capacity(REMEMBERED),
        }
    }

    pub(super) fn changed(&mut self, change: Change) {
        self.change_count += 1;
        if self.changes.len() == REMEMBERED {
            self.changes.pop_front();
        }
        self.changes.push_back(change);
    }

    pub(super) fn last_change(&self) -> Option<Change> {
        self.changes.back().copied()
    }

    pub(super) fn figures(
        &self,
        mode: QualityMode,
        quality: Quality,
        period_ms: f64,
        climb_wait_ms: f64,
    ) -> QualityFigures {
        let step = |(quality, (ms, pictures)): (&Quality, &(f64, u64))| StepFigures {
            quality: *quality,
            kept_share: quality.kept_share(),
            seconds: ms / 1e3,
            pictures: *pictures,
        };
        QualityFigures {
            mode,
            quality,
            period_ms,
            pictures: self.pictures,
            late_pictures: self.late_pictures,
            missed_periods: self.missed_periods,
            missed_elsewhere: self.missed_elsewhere,
            repeated_periods: self.repeated_periods,
            overloaded_at_last_step: self.overloaded_at_last_step,
            change_count: self.change_count,
            failed_climbs: self.failed_climbs,
            climb_wait_seconds: climb_wait_ms / 1e3,
            steps: LADDER.iter().zip(&self.steps).map(step).collect(),
            changes: self.changes.iter().copied().collect(),
        }
    }
}
