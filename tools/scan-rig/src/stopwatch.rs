//! How long the steps of some work take.

use serde::Serialize;
use std::time::Instant;

/// The time of one step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepSeconds {
    /// Its name.
    pub step: &'static str,
    /// Seconds.
    pub seconds: f64,
}

/// Measures steps that follow each other.
pub(crate) struct Stopwatch {
    began: Instant,
    pub(crate) done: Vec<StepSeconds>,
}

impl Stopwatch {
    /// The first step begins.
    pub(crate) fn start() -> Self {
        Self {
            began: Instant::now(),
            done: Vec::new(),
        }
    }

    /// The step of that name ended, and the next begins.
    pub(crate) fn ended(&mut self, step: &'static str) {
        let seconds = self.began.elapsed().as_secs_f64();
        log::debug!("{step}: {seconds:.2} s");
        self.done.push(StepSeconds { step, seconds });
        self.began = Instant::now();
    }
}
