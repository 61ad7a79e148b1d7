//! When a command ends by itself.

use crate::ending;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// When to leave.
#[derive(Debug)]
pub(crate) struct Until {
    stop: Arc<AtomicBool>,
    /// So long after it is first asked, which displays do when all calls are joined.
    longest: Option<Duration>,
    asked: OnceLock<Instant>,
    /// After so many pictures.
    pub(crate) frames: Option<u64>,
}

impl Until {
    /// On `stop`, after `longest`, or after so many pictures.
    pub(crate) fn new(
        stop: &Arc<AtomicBool>,
        longest: Option<Duration>,
        frames: Option<u64>,
    ) -> Self {
        Self {
            stop: Arc::clone(stop),
            longest,
            asked: OnceLock::new(),
            frames,
        }
    }

    /// Whether that time has come, with so many pictures shown.
    pub(crate) fn is_over(&self, shown: u64) -> bool {
        let asked = self.asked.get_or_init(Instant::now);
        let stop = self.stop.load(Relaxed);
        if stop {
            ending::noticed();
        }
        stop || self.frames.is_some_and(|frames| shown >= frames)
            || (self.longest).is_some_and(|longest| asked.elapsed() >= longest)
    }
}
