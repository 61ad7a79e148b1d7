//! What was shown so far: counted for other threads, and how long pictures took to come back after a pause.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// The frames that a receiver has shown.
#[derive(Debug, Clone, Default)]
pub(super) struct ShownFrames {
    with_people: Arc<AtomicU64>,
    /// When the activity came back to the front, until the first frame with people after that.
    resumed: Arc<Mutex<Option<Instant>>>,
}

impl ShownFrames {
    /// Frames with people so far.
    pub(super) fn with_people(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.with_people)
    }

    /// The activity is in front again.
    pub(super) fn resume(&self) {
        *self.resumed.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    }

    /// One more frame. `android/prove.sh` reads the line that the first one after a pause logs.
    pub(super) fn count(&self, has_people: bool) {
        if !has_people {
            return;
        }
        self.with_people.fetch_add(1, Relaxed);
        let resumed = (self.resumed.lock())
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if let Some(resumed) = resumed {
            let ms = resumed.elapsed().as_secs_f64() * 1e3;
            log::info!("pictures are back {ms:.0} ms after the resume");
        }
    }
}
