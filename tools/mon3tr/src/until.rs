//! When a command ends by itself.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Instant;

/// When to leave.
#[derive(Debug, Clone)]
pub(crate) struct Until {
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) deadline: Option<Instant>,
    /// After so many pictures.
    pub(crate) frames: Option<u64>,
}

impl Until {
    /// Whether that time has come, with so many pictures shown.
    pub(crate) fn is_over(&self, shown: u64) -> bool {
        self.stop.load(Relaxed)
            || self.frames.is_some_and(|frames| shown >= frames)
            || (self.deadline).is_some_and(|deadline| Instant::now() >= deadline)
    }
}
