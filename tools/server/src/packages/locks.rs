//! A lock for each key, which exists while somebody has it or waits for it.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::OwnedMutexGuard;

type Lock = Arc<tokio::sync::Mutex<()>>;

#[derive(Debug)]
pub(super) struct Locks<K: Copy + Eq + Hash>(Mutex<HashMap<K, Lock>>);

/// Holds a key's lock, or waits for it.
#[derive(Debug)]
pub(super) struct Held<'a, K: Copy + Eq + Hash> {
    locks: &'a Locks<K>,
    key: K,
    guard: Option<OwnedMutexGuard<()>>,
}

impl<K: Copy + Eq + Hash> Default for Locks<K> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<K: Copy + Eq + Hash> Locks<K> {
    pub(super) async fn lock(&self, key: K) -> Held<'_, K> {
        let (mut held, lock) = self.ask(key);
        held.guard = Some(lock.lock_owned().await);
        held
    }

    fn ask(&self, key: K) -> (Held<'_, K>, Lock) {
        let lock = Arc::clone(self.locked().entry(key).or_default());
        let held = Held {
            locks: self,
            key,
            guard: None,
        };
        (held, lock)
    }

    fn locked(&self) -> MutexGuard<'_, HashMap<K, Lock>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Also where the waiting was given up.
impl<K: Copy + Eq + Hash> Drop for Held<'_, K> {
    fn drop(&mut self) {
        self.guard = None;
        let mut locks = self.locks.locked();
        let lock = locks.get(&self.key);
        if lock.is_some_and(|lock| Arc::strong_count(lock) == 1) {
            locks.remove(&self.key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures_util::FutureExt;

    #[test]
    fn a_key_has_one_holder_and_nothing_is_left_of_it_afterwards() {
        let locks = Locks::default();
        let first = locks.lock(1).now_or_never().expect("free");
        assert!(locks.lock(2).now_or_never().is_some(), "another key");
        let mut waiting = Box::pin(locks.lock(1));
        assert!((&mut waiting).now_or_never().is_none(), "waits");
        drop(first);
        assert!((&mut waiting).now_or_never().is_some(), "its turn");
        drop(waiting);
        let third = locks.lock(1).now_or_never().expect("free");
        let mut gives_up = Box::pin(locks.lock(1));
        assert!((&mut gives_up).now_or_never().is_none(), "waits");
        drop(third);
        drop(gives_up);
        assert!(locks.locked().is_empty(), "nothing is left");
    }
}
