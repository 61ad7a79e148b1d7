//! Asking a renderer, from another thread, to be done soon.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Whether the GPU is wanted back. Copies are the same one.
///
/// While it is raised, a renderer returns after one picture, also where it compares its back ends: the next picture goes on with that.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Raises it, or takes it back.
    pub fn set(&self, raised: bool) {
        self.0.store(raised, Relaxed);
    }

    /// Whether it is raised.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Relaxed)
    }
}
