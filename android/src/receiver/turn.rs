//! One receiver at a time: Android may make an activity before it destroys the last one, in the same process, and both need the one
//! headset.

use app_pipeline::control::Control;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How often to check whether it is time to leave.
const LOOK: Duration = Duration::from_millis(50);

/// The lock of this process's receivers.
pub(super) static HEADSET: Turns = Turns::new();

/// Whether a receiver holds the turn.
pub(super) struct Turns {
    is_taken: Mutex<bool>,
    changed: Condvar,
}

/// A turn, until it is dropped.
pub(super) struct Turn<'a>(&'a Turns);

impl Turns {
    const fn new() -> Self {
        Self {
            is_taken: Mutex::new(false),
            changed: Condvar::new(),
        }
    }

    /// Waits until no other receiver has the headset; nothing if it is time to leave before.
    pub(super) fn wait(&self, control: &Control) -> Option<Turn<'_>> {
        let mut is_taken = self.lock();
        let mut is_logged = false;
        while *is_taken {
            if control.is_leaving() {
                return None;
            }
            if !std::mem::replace(&mut is_logged, true) {
                log::info!(
                    "the activity before this one has the headset still: waiting for its end"
                );
            }
            let waited = self.changed.wait_timeout(is_taken, LOOK);
            is_taken = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        *is_taken = true;
        Some(Turn(self))
    }

    fn lock(&self) -> MutexGuard<'_, bool> {
        self.is_taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        *self.0.lock() = false;
        self.0.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_receiver_waits_for_the_one_before_it_or_leaves() {
        let turns = Turns::new();
        let first = turns.wait(&Control::default());
        assert!(first.is_some(), "no other receiver");
        std::thread::scope(|scope| {
            let (staying, leaving) = (Control::default(), Control::default());
            let wait = |control: &Control| {
                let control = control.clone();
                let turns = &turns;
                scope.spawn(move || turns.wait(&control).is_some())
            };
            let (second, third) = (wait(&staying), wait(&leaving));
            leaving.leave();
            assert!(!third.join().expect("no panic"), "left without a turn");
            assert!(!second.is_finished(), "waits");
            drop(first);
            assert!(second.join().expect("no panic"), "has its turn");
        });
        assert!(turns.wait(&Control::default()).is_some(), "given back");
    }
}
