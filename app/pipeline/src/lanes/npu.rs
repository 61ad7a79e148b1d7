//! The NPU lane: the deform graph on whichever provider was chosen, and on another when that one fails.

use super::motion::Posed;
use super::triple_buffer::{Reader, WakeSignal, Writer};
use crate::error::ReceiverError;
use crate::inference::Inference;
use crate::profile::Recorder;
use crate::stage::Stage;
use npu_runtime::Outputs;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// How long the lane sleeps at most before it looks whether it is to stop.
const PATIENCE: Duration = Duration::from_millis(100);

/// What the graph made of a pose.
#[derive(Debug)]
pub(super) struct Inferred {
    pub(super) outputs: Outputs,
    pub(super) posed: Posed,
}

/// The lane's thread.
#[derive(Debug)]
pub(super) struct NpuLane {
    pub(super) inference: Inference,
    pub(super) posed: Reader<Posed>,
    pub(super) inferred: Writer<Inferred>,
    pub(super) bell: WakeSignal,
    pub(super) recorder: Recorder,
}

impl NpuLane {
    /// Until `stop`, or until no provider is left.
    ///
    /// # Errors
    /// The last provider's.
    pub(super) fn run(mut self, stop: &AtomicBool) -> Result<(), ReceiverError> {
        while !stop.load(Relaxed) {
            if !self.posed.take() {
                self.bell.wait(PATIENCE);
                continue;
            }
            let posed = self.posed.taken();
            let place = self.inferred.place();
            let begun = Instant::now();
            self.inference
                .run(&posed.pose.motion, &posed.skinning, &mut place.outputs)?;
            let ended =
                self.recorder
                    .span_until_now(Stage::Inference, posed.pose.times.number, begun);
            place.posed.clone_from(posed);
            place.posed.pose.times.inference = [begun, ended];
            self.inferred.give();
        }
        Ok(())
    }
}
