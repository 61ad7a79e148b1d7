//! The wearer's head and hands on their way from the headset's loop to whoever captures their motion: the newest wins.

use renderer_openxr::wearer::Wearer;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Hands over where the wearer is. Copies are the same one.
#[derive(Debug, Clone, Default)]
pub struct WearerSlot(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    newest: Option<Wearer>,
    over: bool,
}

struct CloseAtEnd(WearerSlot);

impl Drop for CloseAtEnd {
    fn drop(&mut self) {
        self.0.close();
    }
}

/// What a [`WearerSlot`] has.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is one at a time, and nearly all of them are the large one"
)]
pub enum WearerNews {
    /// The wearer, as of the newest frame that was not taken yet.
    At(Wearer),
    /// Nothing new in the time that was waited.
    Nothing,
    /// Nothing more will come.
    Over,
}

impl WearerSlot {
    /// Puts the wearer there, in the place of one that nobody took.
    pub fn put(&self, wearer: Wearer) {
        self.lock().newest = Some(wearer);
        self.0.changed.notify_all();
    }

    /// Says that nothing more will come.
    pub fn close(&self) {
        self.lock().over = true;
        self.0.changed.notify_all();
    }

    /// Says so when it is dropped, also by a panic of who fills the slot.
    #[must_use]
    pub fn close_at_end(&self) -> impl Drop + use<> {
        CloseAtEnd(self.clone())
    }

    /// Takes what is there, or waits for it no longer than `longest`.
    #[must_use]
    pub fn wait(&self, longest: Duration) -> WearerNews {
        let waited = (self.0.changed).wait_timeout_while(self.lock(), longest, |state| {
            state.newest.is_none() && !state.over
        });
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        match state.newest.take() {
            _ if state.over => WearerNews::Over,
            Some(wearer) => WearerNews::At(wearer),
            None => WearerNews::Nothing,
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
