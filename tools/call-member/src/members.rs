//! Who else is in the call.

use app_session::call::CallWatch;
use link_voice::VoiceQueue;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Another person in the call.
#[derive(Debug, Clone)]
pub struct Member {
    /// What they are called.
    pub name: String,
    /// What the call with them counts and tells.
    pub watch: CallWatch,
    /// What they say, to be played.
    pub voice: VoiceQueue,
}

/// The other people who are in the call, by their seats. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Members(Arc<Mutex<Vec<Member>>>);

impl Members {
    /// All of them now.
    #[must_use]
    pub fn all(&self) -> Vec<Member> {
        self.lock().clone()
    }

    /// All of them, for as long as it is held: the roster waits meanwhile.
    pub fn lock(&self) -> MutexGuard<'_, Vec<Member>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
