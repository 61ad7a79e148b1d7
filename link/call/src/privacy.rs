//! Whether a person in a call is heard and seen, as they choose.

use link_protocol::data_channel::PersonState;
use tokio::sync::watch;

/// A person's choice to be heard and seen. Clones share it: a key changes it, the sender keeps to it, and viewers are told.
#[derive(Debug, Clone)]
pub struct Privacy(watch::Sender<PersonState>);

impl Default for Privacy {
    /// Heard and seen.
    fn default() -> Self {
        Self(watch::Sender::new(PersonState::default()))
    }
}

impl Privacy {
    /// What holds now.
    #[must_use]
    pub fn state(&self) -> PersonState {
        *self.0.borrow()
    }

    /// From now on this holds.
    pub fn set(&self, state: PersonState) {
        self.change(|now| *now = state);
    }

    /// Is heard from now on, or is not.
    pub fn mute(&self, muted: bool) {
        self.change(|state| state.muted = muted);
    }

    /// Is no longer heard, or is again; what holds now.
    pub fn toggle_mute(&self) -> PersonState {
        self.change(|state| state.muted = !state.muted)
    }

    /// Is no longer seen, or is again; what holds now.
    pub fn toggle_hide(&self) -> PersonState {
        self.change(|state| state.hidden = !state.hidden)
    }

    fn change(&self, change: impl FnOnce(&mut PersonState)) -> PersonState {
        self.0.send_if_modified(|state| {
            let before = *state;
            change(state);
            *state != before
        });
        self.state()
    }

    pub(crate) fn subscribe(&self) -> watch::Receiver<PersonState> {
        self.0.subscribe()
    }
}
