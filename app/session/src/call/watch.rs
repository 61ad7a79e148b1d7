//! What a call counts and tells, for who shows it meanwhile, and the way to leave it: the call itself belongs to a lane then.

use identity::PublicKey;
use link_call::CallError;
use link_protocol::PersonName;
use link_protocol::data_channel::PersonState;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};

/// What came and what did not, since the call was begun.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CallCounts {
    /// Bytes of all messages, without any header.
    pub payload_bytes: u64,
    /// Frames that passed every check.
    pub frames: u64,
    /// Frames that never came, by gaps in the sequence. One that is on its way counts until it is here, so that it may fall.
    pub lost: u64,
}

/// Reads a call's counts from any thread, and leaves it; they are a tenth of a second old at most while the call is followed.
#[derive(Debug, Clone, Default)]
pub struct CallWatch(Arc<Counts>);

/// Each is read by itself: two of them may be of two frames, which no panel shows.
#[derive(Debug, Default)]
struct Counts {
    payload_bytes: AtomicU64,
    frames: AtomicU64,
    lost: AtomicU64,
    muted: AtomicBool,
    hidden: AtomicBool,
    leaves: AtomicBool,
    is_over: AtomicBool,
    waits: AtomicBool,
    /// Why the call failed.
    failure: OnceLock<String>,
    /// Who it is: the key, and the name that was signed with it.
    sender: OnceLock<(Option<PublicKey>, Option<PersonName>)>,
}

impl CallWatch {
    /// The counts.
    #[must_use]
    pub fn counts(&self) -> CallCounts {
        CallCounts {
            payload_bytes: self.0.payload_bytes.load(Relaxed),
            frames: self.0.frames.load(Relaxed),
            lost: self.0.lost.load(Relaxed),
        }
    }

    /// Whether the person is heard and seen, as they chose.
    #[must_use]
    pub fn state(&self) -> PersonState {
        PersonState {
            muted: self.0.muted.load(Relaxed),
            hidden: self.0.hidden.load(Relaxed),
        }
    }

    /// The key of the person, or that they show none; nothing before the first connection with them.
    #[must_use]
    pub fn key(&self) -> Option<Option<PublicKey>> {
        self.0.sender.get().map(|(key, _)| *key)
    }

    /// What the person is called, as they signed with their key.
    #[must_use]
    pub fn person(&self) -> Option<PersonName> {
        self.0.sender.get().and_then(|(_, person)| person.clone())
    }

    /// Has this side leave the call with them.
    pub fn leave(&self) {
        self.0.leaves.store(true, Relaxed);
    }

    /// Whether nothing more is to come of them: they said goodbye, it failed, or this side has left.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.0.is_over.load(Relaxed) || self.is_left()
    }

    /// Whether the person is asked to let this side in.
    #[must_use]
    pub fn waits(&self) -> bool {
        self.0.waits.load(Relaxed)
    }

    /// Why the call failed, if it has; nothing where it ended otherwise.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.0.failure.get().map(String::as_str)
    }

    /// Whether both read the same call.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    pub(crate) fn is_left(&self) -> bool {
        self.0.leaves.load(Relaxed)
    }

    pub(crate) fn know(&self, sender: Option<PublicKey>, person: Option<PersonName>) {
        self.0.sender.get_or_init(|| (sender, person));
    }

    pub(crate) fn fail(&self, why: &CallError) {
        self.0.failure.get_or_init(|| why.to_string());
    }

    pub(crate) fn end(&self) {
        self.0.is_over.store(true, Relaxed);
    }

    pub(crate) fn tell_state(&self, state: PersonState) {
        self.0.muted.store(state.muted, Relaxed);
        self.0.hidden.store(state.hidden, Relaxed);
    }

    pub(crate) fn tell_waits(&self, waits: bool) {
        self.0.waits.store(waits, Relaxed);
    }

    pub(crate) fn tell(&self, counts: CallCounts) {
        self.0.payload_bytes.store(counts.payload_bytes, Relaxed);
        self.0.frames.store(counts.frames, Relaxed);
        self.0.lost.store(counts.lost, Relaxed);
    }
}
