//! How many watch through the server's forwarders, as these say: for the performer to know.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The viewers of all forwarders. Clones share them.
#[derive(Debug, Clone, Default)]
pub(super) struct Watching(Arc<AtomicU64>);

/// What one forwarder says, until it is dropped.
#[derive(Debug)]
pub(super) struct Forwards {
    all: Watching,
    viewers: u32,
}

impl Watching {
    pub(super) fn begin(&self) -> Forwards {
        Forwards {
            all: self.clone(),
            viewers: 0,
        }
    }

    /// All of them.
    pub(super) fn viewers(&self) -> u64 {
        self.0.load(Relaxed)
    }
}

impl Forwards {
    /// It forwards to so many now.
    pub(super) fn report(&mut self, viewers: u32) {
        self.all.0.fetch_add(viewers.into(), Relaxed);
        self.all.0.fetch_sub(self.viewers.into(), Relaxed);
        self.viewers = viewers;
    }
}

impl Drop for Forwards {
    fn drop(&mut self) {
        self.report(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_forwarder_said_last_counts_and_ends_with_it() {
        let watching = Watching::default();
        let (mut one, mut other) = (watching.begin(), watching.begin());
        one.report(u32::MAX);
        other.report(u32::MAX);
        assert_eq!(watching.viewers(), 2 * u64::from(u32::MAX), "no overflow");
        drop(one);
        other.report(4);
        assert_eq!(watching.viewers(), 4, "the other's, the newest");
        drop(other);
        assert_eq!(watching.viewers(), 0, "nobody's");
    }
}
