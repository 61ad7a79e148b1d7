//! The progress of a bake, and how long its steps take.

use super::report::StepTime;
use std::time::Instant;

/// Receives the progress of a bake. Calls come from several threads.
pub trait Progress: Sync {
    /// A step of `total` parts begins (1 for a step that cannot be split).
    fn begin(&self, step: &'static str, total: usize);
    /// One part of the current step is done.
    fn advance(&self);
}

/// Ignores the progress.
impl Progress for () {
    fn begin(&self, _: &'static str, _: usize) {}
    fn advance(&self) {}
}

/// Measures steps and passes them on.
pub(super) struct Clock<'a> {
    pub(super) progress: &'a dyn Progress,
    pub(super) steps: Vec<StepTime>,
    began: Instant,
}

impl<'a> Clock<'a> {
    pub(super) fn new(progress: &'a dyn Progress) -> Self {
        Self {
            progress,
            steps: Vec::new(),
            began: Instant::now(),
        }
    }

    pub(super) fn begin(&mut self, step: &'static str, total: usize) {
        self.end();
        self.progress.begin(step, total);
        self.steps.push(StepTime {
            step: step.to_owned(),
            seconds: 0.0,
        });
    }

    pub(super) fn end(&mut self) {
        if let Some(step) = self.steps.last_mut() {
            step.seconds = self.began.elapsed().as_secs_f32();
        }
        self.began = Instant::now();
    }
}
