//! From one thread to another: the newest only.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// A place for one thing, which the next one replaces. Putting never waits.
#[derive(Debug)]
pub(crate) struct HandOver<T> {
    state: Mutex<State<T>>,
    changed: Condvar,
}

#[derive(Debug)]
struct State<T> {
    newest: Option<T>,
    dropped: u64,
    is_closed: bool,
}

impl<T> Default for HandOver<T> {
    fn default() -> Self {
        Self {
            state: Mutex::new(State {
                newest: None,
                dropped: 0,
                is_closed: false,
            }),
            changed: Condvar::new(),
        }
    }
}

impl<T> HandOver<T> {
    /// Puts the newest there. What has not been taken is dropped and counted.
    pub(crate) fn put(&self, newest: T) {
        let mut state = self.lock();
        if state.is_closed {
            return;
        }
        let old = state.newest.replace(newest);
        state.dropped += u64::from(old.is_some());
        drop(state);
        self.changed.notify_one();
        // After the lock: it may be large.
        drop(old);
    }

    /// Waits for something to take; nothing once it is closed.
    pub(crate) fn take(&self) -> Option<T> {
        let is_waiting = |state: &mut State<T>| state.newest.is_none() && !state.is_closed;
        let state = self.changed.wait_while(self.lock(), is_waiting);
        let mut state = state.unwrap_or_else(PoisonError::into_inner);
        state.newest.take()
    }

    /// Takes what is there, if there is something.
    pub(crate) fn take_now(&self) -> Option<T> {
        self.lock().newest.take()
    }

    /// Nothing more is put or taken.
    pub(crate) fn close(&self) {
        let mut state = self.lock();
        state.is_closed = true;
        state.newest = None;
        drop(state);
        self.changed.notify_all();
    }

    /// Whether it is closed.
    pub(crate) fn is_closed(&self) -> bool {
        self.lock().is_closed
    }

    /// How many were dropped.
    pub(crate) fn dropped(&self) -> u64 {
        self.lock().dropped
    }

    fn lock(&self) -> MutexGuard<'_, State<T>> {
        // Each change is whole before a thread could panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn the_newest_is_taken_and_what_it_replaced_is_counted() {
        let place = HandOver::default();
        for number in 0..10 {
            place.put(number);
        }
        assert_eq!(place.take(), Some(9));
        assert_eq!(place.dropped(), 9);
        assert_eq!(place.take_now(), None);
        place.put(10);
        assert_eq!((place.take_now(), place.dropped()), (Some(10), 9));
    }

    #[test]
    fn closing_wakes_who_waits_and_keeps_nothing() {
        let place = Arc::new(HandOver::<Arc<()>>::default());
        let waiting = std::thread::spawn({
            let place = Arc::clone(&place);
            move || place.take()
        });
        place.close();
        assert_eq!(waiting.join().expect("no panic"), None);
        let kept = Arc::new(());
        place.put(Arc::clone(&kept));
        assert_eq!(Arc::strong_count(&kept), 1, "a closed place keeps nothing");
        assert_eq!(place.take(), None);
    }
}
