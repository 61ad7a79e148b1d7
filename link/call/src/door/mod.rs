//! A room's door: who comes in, as the performer decides; who waits before it, who is inside, and who is sent away.

mod places;
mod rules;
mod seated;
mod stay;
mod visits;

use crate::visitor::{Visitor, Who};
use crate::{CallError, now};
use identity::PublicKey;
use link_protocol::{Guest, Name, Refusal};
use rules::Verdict;
use seated::Seated;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::{Notify, watch};
use tokio::time::Instant;
use visits::{Inside, State};

pub use rules::DoorRules;
pub(crate) use stay::{LOOK, Stay};

/// Viewers that are served directly at once: what a home's uplink carries easily.
pub(crate) const MOST_INSIDE: usize = 32;

/// Why viewers have to go.
const SENT_AWAY: &str = "the performer has sent it away";
const MADE_ROOM: &str = "it makes room for a viewer of another network";
const NO_ROOM: &str = "all places are taken";
const NO_SEAT: &str = "its key sits in the call no longer";

/// Decisions that are kept of each kind, the newest.
const MOST_KEPT: usize = 256;

/// What has happened and is not yet told, at most: what is older is told no more.
const MOST_EVENTS: usize = 256;

/// What happens at the door.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DoorEvent {
    /// A visitor of this number waits to be let in.
    Waits(u32, Visitor),
    /// They wait no longer: they have given up.
    GaveUp(u32, Visitor),
    /// More want to come in with the room's own link than can be told of.
    Crowded,
    /// A viewer is inside.
    Entered(u32, Visitor),
    /// They have left.
    Left(u32, Visitor),
}

/// Someone at the door or inside.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seen {
    /// By which the performer names them; the same visitor keeps it.
    pub number: u32,
    /// Who they are.
    pub visitor: Visitor,
    /// Whether they wait to be let in.
    pub waits: bool,
    /// Whether the server serves them: whether they are connected already is not known then.
    pub handed_over: bool,
}

/// Who comes in, as the performer decides. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Door(Arc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    state: Mutex<State>,
    /// Something has to be said to the server.
    changed: Notify,
    /// In a call: who sits there.
    seated: Seated,
}

impl Door {
    /// One where the performer has decided this before.
    #[must_use]
    pub fn new(rules: DoorRules) -> Self {
        let door = Self::default();
        door.locked().rules = rules;
        door
    }

    /// What has been decided so far.
    #[must_use]
    pub fn rules(&self) -> DoorRules {
        self.locked().rules.clone()
    }

    /// Lets nobody new in from now on, or does again; whether it is locked then.
    pub fn toggle_lock(&self) -> bool {
        let mut state = self.locked();
        state.rules.locked = !state.rules.locked;
        state.note_who_is_inside();
        state.rules.locked
    }

    /// Notes that a guest has a link.
    ///
    /// # Errors
    /// [`CallError::TooManyGuests`] if so many have links that hold.
    pub fn invite(&self, guest: Guest) -> Result<(), CallError> {
        self.locked().rules.invite(guest, now())
    }

    /// Lets in whoever of this number waits, also if the same key was sent away meanwhile with another link. Who they are.
    pub fn admit(&self, number: u32) -> Option<Visitor> {
        let mut state = self.locked();
        let (who, visitor) = state.take_waiting(number)?;
        state.rules.admit(who);
        Some(visitor)
    }

    /// Sends away all who have this number: who waits, is inside, or was handed over. They do not come in again, neither by another link; of one without key and
    /// guest's link that cannot be known, so nobody comes in without either from then on. Who they are.
    pub fn remove(&self, number: u32) -> Option<Visitor> {
        let mut state = self.locked();
        let seen = state.seen().into_iter();
        let visitors: Vec<Visitor> = seen
            .filter(|seen| seen.number == number)
            .map(|seen| seen.visitor)
            .collect();
        for visitor in &visitors {
            state.rules.remove(visitor);
        }
        state.take_waiting(number);
        for inside in state.inside.iter().filter(|inside| inside.number == number) {
            inside.send_away(SENT_AWAY);
        }
        state.end_handed_over(|of, _| of == number);
        self.0.changed.notify_one();
        visitors.into_iter().next()
    }

    /// The same of a member of a call by their key, whether or not they are connected to this side.
    pub fn remove_member(&self, key: PublicKey) {
        let visitor = Visitor {
            key: Some(key),
            guest: None,
        };
        let mut state = self.locked();
        state.rules.remove(&visitor);
        let number = state.number_of(&visitor);
        state.take_waiting(number);
        for inside in (state.inside.iter()).filter(|inside| inside.visitor.key == Some(key)) {
            inside.send_away(SENT_AWAY);
        }
    }

    /// In a call: the server, which was asked at `asked`, says that members with these keys sit there now. Viewers
    /// whose key has sat nowhere for ten seconds have to go.
    pub fn seat_members(&self, asked: std::time::Instant, keys: &[PublicKey]) {
        self.0.seated.note(Instant::from_std(asked), keys);
        let state = self.locked();
        for inside in &state.inside {
            let is_seated = inside.visitor.key.is_some_and(|key| self.0.seated.has(key));
            if !is_seated {
                inside.send_away(NO_SEAT);
            }
        }
    }

    /// Whether a member of a call with this key would be let in now, unasked. This side neither sees nor hears members
    /// who would not.
    #[must_use]
    pub fn lets_in(&self, key: PublicKey) -> bool {
        let visitor = Visitor {
            key: Some(key),
            guest: None,
        };
        self.locked().rules.verdict(&visitor, None, now()) == Verdict::Enters
    }

    /// Whether a member of a call with this key was sent away.
    #[must_use]
    pub fn has_removed(&self, key: PublicKey) -> bool {
        self.locked().rules.removed.contains(&Who::Key(key))
    }

    /// Whether a viewer with this key is inside.
    #[must_use]
    pub fn has_inside(&self, key: PublicKey) -> bool {
        let is_theirs = |inside: &Inside| inside.visitor.key == Some(key);
        self.locked().inside.iter().any(is_theirs)
    }

    /// Whether this viewer's key sits in the call, as the server says that is asked from now on; nothing if it does not
    /// answer.
    pub(crate) async fn is_seated(&self, visitor: &Visitor) -> Option<bool> {
        match visitor.key {
            Some(key) => self.0.seated.has_or_will(key).await,
            None => Some(false),
        }
    }

    /// Whether there is a place for a viewer from this network, or another viewer would make room for it.
    pub(crate) fn has_room(&self, visitor: &Visitor, network: Option<&Name>) -> bool {
        let state = self.locked();
        state.stay() < MOST_INSIDE || state.makes_room(visitor, network).is_some()
    }

    /// Who waits and who is inside.
    #[must_use]
    pub fn seen(&self) -> Vec<Seen> {
        self.locked().seen()
    }

    /// What has happened since this was asked last, one by one.
    #[must_use]
    pub fn next_event(&self) -> Option<DoorEvent> {
        let mut state = self.locked();
        state.forget_who_gave_up();
        state.events.pop_front()
    }

    /// A viewer wants to come in with the token that the server calls `token`, if it says so: whether it may, and if not, what it is answered. `now` is seconds
    /// since 1970.
    pub(crate) fn knock(
        &self,
        visitor: &Visitor,
        token: Option<&Name>,
        now: u64,
    ) -> Result<(), Refusal> {
        let mut state = self.locked();
        state.forget_who_gave_up();
        match state.rules.verdict(visitor, token, now) {
            Verdict::Enters => Ok(()),
            Verdict::Asked(who) => Err(state.wait(who, visitor)),
            Verdict::Refused(refusal) => Err(refusal),
        }
    }

    /// A viewer from this network is connected. Where all places are taken another one makes room, or this one has to
    /// go.
    pub(crate) fn enter(&self, visitor: Visitor, network: Option<Name>) -> Stay {
        let leave = watch::Sender::new(None);
        let mut state = self.locked();
        let number = state.number_of(&visitor);
        if state.rules.has_removed(&visitor) {
            // Removed between its answer and its connection.
            leave.send_replace(Some(SENT_AWAY));
        } else {
            state.note_entered(&visitor);
        }
        if state.stay() >= MOST_INSIDE {
            match state.makes_room(&visitor, network.as_ref()) {
                Some(other) => other.send_away(MADE_ROOM),
                None => drop(leave.send_replace(Some(NO_ROOM))),
            }
        }
        state.tell(DoorEvent::Entered(number, visitor.clone()));
        state.inside.push(Inside {
            number,
            visitor: visitor.clone(),
            network,
            leave: leave.clone(),
        });
        Stay {
            door: self.clone(),
            number,
            visitor,
            leave,
        }
    }

    /// A viewer is handed over to the server; not where too many were already.
    pub(crate) fn hand_over(&self, visitor: Visitor, session: Name) -> bool {
        self.locked().hand_over(visitor, session)
    }

    /// The server says that this session has ended.
    pub(crate) fn left(&self, session: &Name) {
        self.locked().left(session);
    }

    /// Has the server end what it serves to guests whose time is over. `now` is seconds since 1970.
    pub(crate) fn end_expired(&self, now: u64) {
        let is_over =
            |visitor: &Visitor| (visitor.guest.as_ref()).is_some_and(|it| it.expires <= now);
        if self.locked().end_handed_over(|_, visitor| is_over(visitor)) {
            self.0.changed.notify_one();
        }
    }

    /// Waits until something has to be said to the server.
    pub(crate) async fn changed(&self) {
        self.0.changed.notified().await;
    }

    /// The sessions that the server is to end, once each.
    pub(crate) fn take_sessions_to_end(&self) -> Vec<Name> {
        std::mem::take(&mut self.locked().to_end)
    }

    /// The tokens of guests who were sent away, the newest, `most` at most. `now` is seconds since 1970.
    pub(crate) fn revoked(&self, most: usize, now: u64) -> Vec<Name> {
        self.locked().rules.revoked(most, now)
    }

    fn locked(&self) -> MutexGuard<'_, State> {
        // Nothing in here is half-changed after a panic elsewhere.
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Keeps `one` as the newest of `kept`, once.
fn keep<T: PartialEq>(kept: &mut Vec<T>, one: T) {
    kept.retain(|other| *other != one);
    if kept.len() == MOST_KEPT {
        kept.remove(0);
    }
    kept.push(one);
}

#[cfg(test)]
mod tests;
