//! Cancelling the loading of graphs from another thread: compiling one for an NPU takes seconds, and a program that is closed must end
//! sooner.

use ort::session::builder::LoadCanceler;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Cancels loads of graphs, those under way and all later ones, of the runtimes that [`crate::Runtime::cancelled_by`] made with it. Copies
/// are the same one.
#[derive(Debug, Clone, Default)]
pub struct Cancel(Arc<Mutex<Loads>>);

#[derive(Debug, Default)]
struct Loads {
    cancelled: bool,
    /// Each with its number.
    under_way: Vec<(u64, LoadCanceler)>,
    begun: u64,
}

impl Cancel {
    /// Cancels. ONNX Runtime looks for it between the steps of its own work; a provider's compiler may not.
    pub fn cancel(&self) {
        let mut loads = self.lock();
        loads.cancelled = true;
        for (_, load) in &loads.under_way {
            tell(load);
        }
    }

    /// Whether [`Self::cancel`] was called.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.lock().cancelled
    }

    /// A load begins; it can be cancelled until the result is dropped.
    pub(crate) fn begin(&self, load: LoadCanceler) -> Load<'_> {
        let mut loads = self.lock();
        if loads.cancelled {
            tell(&load);
        }
        loads.begun += 1;
        let number = loads.begun;
        loads.under_way.push((number, load));
        drop(loads);
        Load {
            cancel: self,
            number,
        }
    }

    fn lock(&self) -> MutexGuard<'_, Loads> {
        // What is kept is whole at every moment.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A load that is under way.
pub(crate) struct Load<'a> {
    cancel: &'a Cancel,
    number: u64,
}

impl Drop for Load<'_> {
    fn drop(&mut self) {
        let mut loads = self.cancel.lock();
        loads.under_way.retain(|(number, _)| *number != self.number);
    }
}

fn tell(load: &LoadCanceler) {
    if let Err(error) = load.cancel() {
        log::warn!("the loading of a graph cannot be cancelled: {error}");
    }
}
