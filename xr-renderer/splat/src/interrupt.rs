//! Asks a renderer, from another thread, to return early.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Whether the renderer should return early. Clones share one flag.
///
/// While it is raised, a renderer returns after one picture, also where it compares its back ends: the next picture continues the comparison.
#[derive(Debug, Clone, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Raises it, or clears it.
    pub fn set(&self, raised: bool) {
        self.0.store(raised, Relaxed);
    }

    /// Whether it is raised.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Relaxed)
    }
}
