//! Places that owners share, so that none of them keeps the others out: each owner has a queue of its own, and owners take turns.

use crate::Id;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::oneshot;

/// How many of the places one owner may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Share {
    /// All that nobody else waits for: for work that ends soon by itself.
    All,
    /// No more than are left free, so that some always are: for work that lasts as long as its client likes.
    AsManyAsAreLeft,
}

/// The places. Clones share them.
#[derive(Clone, Debug)]
pub(super) struct Places(Arc<Mutex<Shared>>);

#[derive(Debug)]
struct Shared {
    free: usize,
    share: Share,
    /// Most that wait, of one owner.
    most_waiting: usize,
    /// Those that have a place or wait for one.
    owners: HashMap<Id, Owner>,
    /// Those that wait, each once, in the order of their turns.
    turns: VecDeque<Id>,
}

#[derive(Debug, Default)]
struct Owner {
    held: usize,
    waiting: VecDeque<oneshot::Sender<Place>>,
}

/// A place; dropping it gives it to whose turn it is.
#[derive(Debug)]
pub(super) struct Place {
    places: Places,
    owner: Id,
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.locked().take_back(self.owner);
        self.places.give();
    }
}

impl Places {
    pub(super) fn new(places: usize, share: Share, most_waiting: usize) -> Self {
        Self(Arc::new(Mutex::new(Shared {
            free: places,
            share,
            most_waiting,
            owners: HashMap::new(),
            turns: VecDeque::new(),
        })))
    }

    /// Waits for a place. Nothing where too many of this owner's wait already.
    pub(super) async fn take(&self, owner: Id) -> Option<Place> {
        let place = self.locked().queue(owner)?;
        self.give();
        place.await.ok()
    }

    /// Gives free places to those who wait.
    fn give(&self) {
        loop {
            // The lock is free again before a place is sent: one that nobody receives is dropped, which takes the lock.
            let next = self.locked().next();
            let Some((owner, waits)) = next else { return };
            let places = self.clone();
            drop(waits.send(Place { places, owner }));
        }
    }

    fn locked(&self) -> MutexGuard<'_, Shared> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shared {
    fn queue(&mut self, id: Id) -> Option<oneshot::Receiver<Place>> {
        let owner = self.owners.entry(id).or_default();
        owner.waiting.retain(|waits| !waits.is_closed());
        if owner.waiting.len() >= self.most_waiting {
            return None;
        }
        let (waits, place) = oneshot::channel();
        owner.waiting.push_back(waits);
        if !self.turns.contains(&id) {
            self.turns.push_back(id);
        }
        Some(place)
    }

    /// Who gets a place now: it is taken.
    fn next(&mut self) -> Option<(Id, oneshot::Sender<Place>)> {
        for _ in 0..self.turns.len() {
            let id = self.turns.pop_front()?;
            let Some(owner) = self.owners.get_mut(&id) else {
                continue;
            };
            owner.waiting.retain(|waits| !waits.is_closed());
            let may = match self.share {
                Share::All => self.free > 0,
                Share::AsManyAsAreLeft => owner.held < self.free,
            };
            let given = may.then(|| owner.waiting.pop_front()).flatten();
            if given.is_some() {
                owner.held += 1;
                self.free -= 1;
            }
            if !owner.waiting.is_empty() {
                self.turns.push_back(id);
            }
            self.forget_idle(id);
            if let Some(given) = given {
                return Some((id, given));
            }
        }
        None
    }

    fn take_back(&mut self, id: Id) {
        self.free += 1;
        if let Some(owner) = self.owners.get_mut(&id) {
            owner.held = owner.held.saturating_sub(1);
        }
        self.forget_idle(id);
    }

    fn forget_idle(&mut self, id: Id) {
        let is_idle = |owner: &Owner| owner.held == 0 && owner.waiting.is_empty();
        if self.owners.get(&id).is_some_and(is_idle) {
            self.owners.remove(&id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures_util::FutureExt;
    use std::pin::pin;

    fn owner(number: u8) -> Id {
        Id::from_bytes([number; 16])
    }

    /// Takes a place that is to be had at once.
    fn at_once(places: &Places, number: u8) -> Option<Place> {
        places.take(owner(number)).now_or_never().flatten()
    }

    #[test]
    fn one_owner_has_no_more_places_than_it_leaves_to_others() {
        let places = Places::new(8, Share::AsManyAsAreLeft, 100);
        for (number, most) in [(1, 4), (2, 2), (3, 1), (4, 1), (5, 0)] {
            let taken: Vec<_> = std::iter::from_fn(|| at_once(&places, number)).collect();
            assert_eq!(taken.len(), most, "owner {number}");
            // They stay taken.
            taken.into_iter().for_each(std::mem::forget);
        }
        let alone = Places::new(1, Share::AsManyAsAreLeft, 100);
        assert!(at_once(&alone, 1).is_some(), "the only one");
    }

    #[test]
    fn an_owner_with_a_long_queue_takes_turns_with_the_others() {
        let places = Places::new(1, Share::All, 22);
        let first = at_once(&places, 1).expect("free");
        let mut waiting: Vec<_> = (0..22).map(|_| Box::pin(places.take(owner(1)))).collect();
        for one in &mut waiting {
            assert!(one.now_or_never().is_none(), "waits");
        }
        assert!(
            matches!(places.take(owner(1)).now_or_never(), Some(None)),
            "its queue is full"
        );
        let mut other = pin!(places.take(owner(2)));
        assert!((&mut other).now_or_never().is_none(), "waits");
        drop(first);
        let second = waiting.remove(0).now_or_never().flatten();
        assert!((&mut other).now_or_never().is_none(), "not its turn yet");
        drop(second.expect("in its order"));
        assert!(other.now_or_never().flatten().is_some(), "its turn");
        // Whoever has gone away is passed over, and nothing is left of anybody.
        waiting.truncate(1);
        assert!(waiting.remove(0).now_or_never().flatten().is_some(), "next");
        let shared = places.locked();
        assert_eq!(
            (shared.free, shared.owners.len(), shared.turns.len()),
            (1, 0, 0)
        );
    }
}
