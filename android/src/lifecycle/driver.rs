//! Executes the commands of the state machine.

use super::{Command, Event, Machine, Trim};
use crate::launch::Launch;

/// The call, as the activity's life-cycle drives it. Each function is called from the activity's own thread, in the orders that
/// [`Machine`] knows: `start` once and first, then `pause` and `resume` in turns, `leave` once and last.
pub trait Receiver {
    /// Begins the app's task, or shows in the headset why it cannot. Threads of its own do the work.
    fn start(&mut self, launch: Launch);

    /// Stops the GPU's work: no step of it begins until [`Receiver::resume`], and the one that was begun is waited for, but only briefly, so
    /// that Android's main thread is not held up. No other event is taken before. The call itself, on the network, goes on.
    fn pause(&mut self);

    /// Draws again.
    fn resume(&mut self);

    /// The system is short of memory: what can be made again may be freed.
    fn trim_memory(&mut self, what: Trim);

    /// Hangs up and waits until the receiver's thread has ended, and with it the others. The call is always paused before; what was made
    /// on the GPU is freed here.
    fn leave(&mut self);

    /// Whether the call is over by itself, so that the app may close.
    fn is_over(&self) -> bool;
}

/// One activity's life.
#[derive(Debug)]
pub struct Driver<R> {
    pub(super) machine: Machine,
    pub(super) receiver: R,
    // Until the call begins.
    launch: Option<Launch>,
}

impl<R: Receiver> Driver<R> {
    /// Of an activity that was just made, for this launch.
    pub fn new(receiver: R, launch: Launch) -> Self {
        Self {
            machine: Machine::new(),
            receiver,
            launch: Some(launch),
        }
    }

    /// Takes an event; its commands are done when this returns.
    pub fn on(&mut self, event: Event) {
        let step = self.machine.on(event);
        log::debug!("{event}: {:?}", step.commands);
        if let Some(oddity) = step.oddity {
            log::warn!("{oddity}");
        }
        for command in step.commands {
            self.obey(*command);
        }
    }

    /// Whether the activity is destroyed.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.machine.is_over()
    }

    /// Whether the call has ended by itself and the activity may be closed.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.receiver.is_over()
    }

    fn obey(&mut self, command: Command) {
        match command {
            Command::Start => {
                if let Some(launch) = self.launch.take() {
                    self.receiver.start(launch);
                }
            }
            Command::Pause => self.receiver.pause(),
            Command::Resume => self.receiver.resume(),
            Command::Trim(what) => self.receiver.trim_memory(what),
            Command::Leave => self.receiver.leave(),
        }
    }
}
