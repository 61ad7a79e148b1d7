//! When a command ends by itself.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

/// When to leave.
#[derive(Debug, Clone)]
pub(crate) struct Until {
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) deadline: Option<Instant>,
}

impl Until {
    /// Whether that time has come.
    pub(crate) fn is_over(&self) -> bool {
        self.stop.load(Relaxed)
            || self
                .deadline
                .is_some_and(|deadline| Instant::now() >= deadline)
    }
}
