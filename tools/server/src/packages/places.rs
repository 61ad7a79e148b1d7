//! Places that owners share, so that none of them keeps the others out: each owner has a queue of its own, and owners
//! take turns. Within an owner the calls whose members wait take turns in the same way.

use crate::Id;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;

/// How many of the places one owner may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Share {
    /// All that nobody else waits for: for work that ends soon by itself.
    All,
    /// No more than are left free, so that some always are: for work that lasts as long as its client likes. An owner
    /// without a place, for whom none is free, gets that of another owner with several ([`Place::is_withdrawn`]).
    AsManyAsAreLeft,
}

/// How many places there are, and who may have how many of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shares {
    pub(super) places: usize,
    pub(super) of_owner: Share,
    /// Most that one call has.
    pub(super) of_call: usize,
    /// Most that wait, of one call, or of an owner itself.
    pub(super) waiting: usize,
}

/// Who takes a place: an owner, or the members of one of its calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Party {
    /// The owner's own shelf, or that of its calls' members.
    pub(super) owner: Id,
    pub(super) call: Option<Id>,
}

/// The places. Clones share them.
#[derive(Clone, Debug)]
pub(super) struct Places(Arc<Mutex<Shared>>);

#[derive(Debug)]
struct Shared {
    free: usize,
    shares: Shares,
    /// Those that have a place or wait for one.
    owners: HashMap<Id, Owner>,
    /// Those that wait, each once, in the order of their turns.
    turns: VecDeque<Id>,
    /// The number of the next place that is given.
    next: u64,
}

#[derive(Debug, Default)]
struct Owner {
    /// By their numbers, the oldest first.
    held: VecDeque<(u64, CancellationToken)>,
    calls: HashMap<Option<Id>, Call>,
    /// The calls of which some wait, each once, in the order of their turns.
    turns: VecDeque<Option<Id>>,
}

#[derive(Debug, Default)]
struct Call {
    held: usize,
    waiting: VecDeque<oneshot::Sender<Place>>,
}

/// A place; dropping it gives it to the next owner in turn.
#[derive(Debug)]
pub(super) struct Place {
    places: Places,
    party: Party,
    number: u64,
    withdrawn: CancellationToken,
}

impl Place {
    /// Waits until the place is withdrawn, for an owner that has none.
    pub(super) async fn is_withdrawn(&self) {
        self.withdrawn.cancelled().await;
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.places.locked().take_back(self.party, self.number);
        self.places.give();
    }
}

impl Places {
    pub(super) fn new(shares: Shares) -> Self {
        Self(Arc::new(Mutex::new(Shared {
            free: shares.places,
            shares,
            owners: HashMap::new(),
            turns: VecDeque::new(),
            next: 0,
        })))
    }

    /// Waits for a place. Nothing where too many of this party wait already.
    pub(super) async fn take(&self, party: Party) -> Option<Place> {
        let place = self.locked().queue(party)?;
        self.give();
        self.locked().withdraw_for(party.owner);
        place.await.ok()
    }

    /// Gives free places to those who wait.
    fn give(&self) {
        loop {
            // The lock is free again before a place is sent: one that nobody receives is dropped, which takes the lock.
            let next = self.locked().next();
            let Some(next) = next else { return };
            let place = Place {
                places: self.clone(),
                party: next.party,
                number: next.number,
                withdrawn: next.withdrawn,
            };
            drop(next.waits.send(place));
        }
    }

    fn locked(&self) -> MutexGuard<'_, Shared> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The next place: its party, its number, and the channel to send it by.
struct Next {
    party: Party,
    number: u64,
    withdrawn: CancellationToken,
    waits: oneshot::Sender<Place>,
}

impl Shared {
    fn queue(&mut self, party: Party) -> Option<oneshot::Receiver<Place>> {
        let owner = self.owners.entry(party.owner).or_default();
        let call = owner.calls.entry(party.call).or_default();
        call.waiting.retain(|waits| !waits.is_closed());
        if call.waiting.len() >= self.shares.waiting {
            return None;
        }
        let (waits, place) = oneshot::channel();
        call.waiting.push_back(waits);
        if !owner.turns.contains(&party.call) {
            owner.turns.push_back(party.call);
        }
        if !self.turns.contains(&party.owner) {
            self.turns.push_back(party.owner);
        }
        Some(place)
    }

    /// Who gets a place now: it is taken.
    fn next(&mut self) -> Option<Next> {
        for _ in 0..self.turns.len() {
            let id = self.turns.pop_front()?;
            let Some(owner) = self.owners.get_mut(&id) else {
                continue;
            };
            let may = match self.shares.of_owner {
                Share::All => self.free > 0,
                Share::AsManyAsAreLeft => owner.held.len() < self.free,
            };
            let given = owner.next(may, self.shares.of_call);
            let next = given.map(|(call, waits)| {
                let (number, withdrawn) = (self.next, CancellationToken::new());
                owner.held.push_back((number, withdrawn.clone()));
                self.next += 1;
                self.free -= 1;
                Next {
                    party: Party { owner: id, call },
                    number,
                    withdrawn,
                    waits,
                }
            });
            if !owner.turns.is_empty() {
                self.turns.push_back(id);
            }
            self.forget_idle(id);
            if next.is_some() {
                return next;
            }
        }
        None
    }

    /// Withdraws the oldest place of the owner with the most, where `id` waits without any and none is free.
    fn withdraw_for(&mut self, id: Id) {
        let waits = self.owners.get(&id);
        let waits = waits.is_some_and(|owner| owner.held.is_empty() && !owner.turns.is_empty());
        if self.shares.of_owner == Share::All || self.free > 0 || !waits {
            return;
        }
        let kept = |owner: &Owner| {
            let withdrawn = |(_, withdrawn): &&(u64, CancellationToken)| withdrawn.is_cancelled();
            owner.held.len() - owner.held.iter().filter(withdrawn).count()
        };
        let most = self.owners.values().max_by_key(|owner| kept(owner));
        if let Some(owner) = most.filter(|owner| kept(owner) > 1) {
            let mut held = owner.held.iter();
            if let Some((_, oldest)) = held.find(|(_, withdrawn)| !withdrawn.is_cancelled()) {
                oldest.cancel();
            }
        }
    }

    fn take_back(&mut self, party: Party, number: u64) {
        self.free += 1;
        if let Some(owner) = self.owners.get_mut(&party.owner) {
            owner.held.retain(|(held, _)| *held != number);
            if let Some(call) = owner.calls.get_mut(&party.call) {
                call.held = call.held.saturating_sub(1);
            }
            owner.forget_idle(party.call);
        }
        self.forget_idle(party.owner);
    }

    fn forget_idle(&mut self, id: Id) {
        let is_idle = |owner: &Owner| owner.held.is_empty() && owner.calls.is_empty();
        if self.owners.get(&id).is_some_and(is_idle) {
            self.owners.remove(&id);
        }
    }
}

impl Owner {
    /// The call whose turn it is among those that may have one more place, and who waits first in it. Where the owner
    /// `may` have none, requests that were given up are removed all the same.
    fn next(&mut self, may: bool, most: usize) -> Option<(Option<Id>, oneshot::Sender<Place>)> {
        let mut given = None;
        for _ in 0..self.turns.len() {
            let id = self.turns.pop_front()?;
            let Some(call) = self.calls.get_mut(&id) else {
                continue;
            };
            call.waiting.retain(|waits| !waits.is_closed());
            // An owner itself is bounded by its share alone.
            if given.is_none() && may && (id.is_none() || call.held < most) {
                given = call.waiting.pop_front().map(|waits| (id, waits));
                call.held += usize::from(given.is_some());
            }
            if !call.waiting.is_empty() {
                self.turns.push_back(id);
            }
            self.forget_idle(id);
            if given.is_some() {
                break;
            }
        }
        given
    }

    fn forget_idle(&mut self, id: Option<Id>) {
        let is_idle = |call: &Call| call.held == 0 && call.waiting.is_empty();
        if self.calls.get(&id).is_some_and(is_idle) {
            self.calls.remove(&id);
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

    fn itself(number: u8) -> Party {
        Party {
            owner: owner(number),
            call: None,
        }
    }

    fn sharing(places: usize, of_owner: Share, waiting: usize) -> Places {
        Places::new(Shares {
            places,
            of_owner,
            of_call: 2,
            waiting,
        })
    }

    /// Takes a place that is to be had at once.
    fn at_once(places: &Places, party: Party) -> Option<Place> {
        places.take(party).now_or_never().flatten()
    }

    #[test]
    fn a_call_has_two_places_and_takes_turns_with_its_owners_other_calls() {
        let places = sharing(8, Share::AsManyAsAreLeft, 3);
        let call = |number| Party {
            owner: owner(1),
            call: Some(owner(number)),
        };
        let held = [(); 2].map(|()| at_once(&places, call(1)).expect("free"));
        let mut waiting: Vec<_> = (0..3).map(|_| Box::pin(places.take(call(1)))).collect();
        for one in &mut waiting {
            assert!(one.now_or_never().is_none(), "waits");
        }
        let full = places.take(call(1)).now_or_never();
        assert!(matches!(full, Some(None)), "its queue is full");
        let others = [(); 2].map(|()| at_once(&places, call(2)).expect("another call's"));
        let mut other = pin!(places.take(call(3)));
        assert!((&mut other).now_or_never().is_none(), "the owner's share");
        let [first, second] = held;
        drop(first);
        let next = waiting.remove(0).now_or_never().flatten();
        let next = next.expect("the first call's turn");
        drop(second);
        assert!((&mut other).now_or_never().flatten().is_some(), "its turn");
        drop((next, others));
        drop(waiting);
        let shared = places.locked();
        assert_eq!(
            (shared.free, shared.owners.len()),
            (8, 0),
            "nothing is left"
        );
    }

    #[test]
    fn an_owner_without_a_place_gets_one_of_who_has_the_most() {
        let places = sharing(4, Share::AsManyAsAreLeft, 3);
        let mut held = [(1, 2), (2, 1), (3, 1)].map(|(number, most)| {
            (0..most)
                .map(|_| at_once(&places, itself(number)).expect("free"))
                .collect::<Vec<_>>()
        });
        let mut more = pin!(places.take(itself(1)));
        assert!((&mut more).now_or_never().is_none(), "it has its share");
        let mut other = pin!(places.take(itself(4)));
        assert!((&mut other).now_or_never().is_none(), "none is free");
        let withdrawn = |place: &Place| place.is_withdrawn().now_or_never().is_some();
        let all: Vec<_> = held.iter().flatten().map(withdrawn).collect();
        assert_eq!(all, [true, false, false, false], "the oldest of the most");
        let mut last = pin!(places.take(itself(5)));
        assert!((&mut last).now_or_never().is_none(), "each has one");
        assert!(
            !held.iter().flatten().skip(1).any(withdrawn),
            "and keeps it"
        );
        held[0].remove(0);
        assert!((&mut more).now_or_never().is_none(), "not who has one");
        assert!(
            (&mut other).now_or_never().flatten().is_some(),
            "who has none"
        );
    }

    #[test]
    fn one_owner_has_no_more_places_than_it_leaves_to_others() {
        let places = sharing(8, Share::AsManyAsAreLeft, 100);
        for (number, most) in [(1, 4), (2, 2), (3, 1), (4, 1), (5, 0)] {
            let taken: Vec<_> = std::iter::from_fn(|| at_once(&places, itself(number))).collect();
            assert_eq!(taken.len(), most, "owner {number}");
            // They stay taken.
            taken.into_iter().for_each(std::mem::forget);
        }
        let alone = sharing(1, Share::AsManyAsAreLeft, 100);
        assert!(at_once(&alone, itself(1)).is_some(), "the only one");
    }

    #[test]
    fn an_owner_with_a_long_queue_takes_turns_with_the_others() {
        let places = sharing(1, Share::All, 22);
        let first = at_once(&places, itself(1)).expect("free");
        let mut waiting: Vec<_> = (0..22).map(|_| Box::pin(places.take(itself(1)))).collect();
        for one in &mut waiting {
            assert!(one.now_or_never().is_none(), "waits");
        }
        assert!(
            matches!(places.take(itself(1)).now_or_never(), Some(None)),
            "its queue is full"
        );
        let mut other = pin!(places.take(itself(2)));
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
