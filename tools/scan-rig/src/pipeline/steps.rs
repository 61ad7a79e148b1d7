//! The order of the work, told as it goes on.

use crate::RigError;
use crate::stopwatch::{StepSeconds, Stopwatch};

/// The steps of a rig, in their order.
pub const STEPS: [&str; 6] = [
    "finding the person",
    "measuring the surface",
    "fitting the body model",
    "binding the Gaussians",
    "completing face and hands",
    "assembling the avatar",
];

/// Tells which of [`STEPS`] begins, and how long each took.
pub(super) struct Steps<'a> {
    told: &'a dyn Fn(&'static str),
    clock: Stopwatch,
}

impl<'a> Steps<'a> {
    /// The steps after those that are done.
    pub(super) fn after(done: Vec<StepSeconds>, told: &'a dyn Fn(&'static str)) -> Self {
        let mut clock = Stopwatch::start();
        clock.done = done;
        Self { told, clock }
    }

    /// Does the next step.
    pub(super) fn run<T>(
        &mut self,
        work: impl FnOnce() -> Result<T, RigError>,
    ) -> Result<T, RigError> {
        let step = STEPS
            .get(self.clock.done.len())
            .copied()
            .unwrap_or_default();
        (self.told)(step);
        let done = work()?;
        self.clock.ended(step);
        Ok(done)
    }

    /// What the steps took.
    pub(super) fn done(self) -> Vec<StepSeconds> {
        self.clock.done
    }
}
