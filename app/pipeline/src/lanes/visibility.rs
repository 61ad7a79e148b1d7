//! Whether a person is drawn.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Whether a person is to be drawn, who is otherwise there. Clones share it: a source of poses sets it, the display's lane keeps to it.
#[derive(Debug, Clone, Default)]
pub struct Visibility(Arc<AtomicBool>);

impl Visibility {
    /// From now on the person is not drawn, or is again.
    pub fn hide(&self, hidden: bool) {
        self.0.store(hidden, Relaxed);
    }

    /// Whether the person is not drawn.
    #[must_use]
    pub fn is_hidden(&self) -> bool {
        self.0.load(Relaxed)
    }
}
