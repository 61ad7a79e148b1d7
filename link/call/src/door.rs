//! A room's door: who comes in, as the performer decides; who waits before it, who is inside, and who is sent away.

use crate::visitor::{Visitor, Who};
use crate::{is_set, now};
use link_protocol::{Guest, Name, Refusal};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, watch};
use tokio::time::Instant;

/// A viewer that waits offers again and again; one that does not for so long has given up.
const GIVEN_UP: Duration = Duration::from_secs(8);

/// Between two looks whether a guest's time is over.
const LOOK: Duration = Duration::from_secs(5);

/// Visitors that wait at once: whoever has the link may make keys as they like.
const MOST_WAITING: usize = 32;

/// Decisions that are kept of each kind, the newest.
const MOST_KEPT: usize = 256;

/// Viewers handed over to the server that are known by name, the newest.
const MOST_HANDED_OVER: usize = 512;

/// What has happened and is not yet told, at most: what is older is told no more.
const MOST_EVENTS: usize = 256;

/// What the performer has decided, so that it can be kept for the next time.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct DoorRules {
    /// Each newcomer waits until the performer lets them in.
    pub ask: bool,
    /// Only guests come in, each by a link of their own.
    pub guests_only: bool,
    /// Nobody comes in who was not inside before.
    pub locked: bool,
    /// Who was let in, and comes in again.
    pub admitted: Vec<Who>,
    /// Who was sent away, and does not come in again.
    pub removed: Vec<Who>,
    /// The guests who were made a link, and what the server calls their tokens.
    pub invited: Vec<(Guest, Name)>,
}

impl DoorRules {
    fn has_removed(&self, visitor: &Visitor) -> bool {
        let mut all = visitor.all_that_it_is();
        all.any(|who| self.removed.contains(&who))
    }
}

/// What happens at the door.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DoorEvent {
    /// A visitor of this number waits to be let in.
    Waits(u32, Visitor),
    /// They wait no longer: they have given up.
    GaveUp(u32, Visitor),
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
    /// Whether the server serves them: whether they are still there is not known then.
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
}

#[derive(Debug, Default)]
struct State {
    rules: DoorRules,
    /// The last number that was given, and to whom.
    numbers: u32,
    numbered: Vec<(Who, u32)>,
    waiting: Vec<Waiting>,
    inside: Vec<Inside>,
    handed_over: VecDeque<HandedOver>,
    /// Sessions that the server is to end.
    to_end: Vec<Name>,
    events: VecDeque<DoorEvent>,
}

#[derive(Debug)]
struct Waiting {
    number: u32,
    who: Who,
    visitor: Visitor,
    knocked: Instant,
}

#[derive(Debug)]
struct Inside {
    number: u32,
    visitor: Visitor,
    leave: watch::Sender<bool>,
}

#[derive(Debug)]
struct HandedOver {
    number: u32,
    visitor: Visitor,
    session: Name,
}

/// A viewer that is inside, until this is dropped.
#[derive(Debug)]
pub(crate) struct Stay {
    door: Door,
    number: u32,
    visitor: Visitor,
    /// Becomes true when the performer sends them away.
    leave: watch::Sender<bool>,
}

impl Stay {
    /// Who is inside.
    pub(crate) fn visitor(&self) -> &Visitor {
        &self.visitor
    }

    /// Waits until a viewer has to go, who is a server's forwarder if there is none; why.
    pub(crate) async fn over(stay: Option<&Self>) -> &'static str {
        let Some(Self { visitor, leave, .. }) = stay else {
            return std::future::pending().await;
        };
        let mut sent_away = leave.subscribe();
        let expires = visitor.guest.as_ref().map(|guest| guest.expires);
        let expired = async {
            match expires {
                // A clock that is set meanwhile is followed.
                Some(expires) => {
                    while now() < expires {
                        let left = Duration::from_secs(expires.saturating_sub(now()));
                        tokio::time::sleep(left.min(LOOK)).await;
                    }
                }
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            () = is_set(&mut sent_away) => "the performer has sent it away",
            () = expired => "its link has ended",
        }
    }
}

impl Drop for Stay {
    fn drop(&mut self) {
        let mut state = self.door.locked();
        let here = |inside: &Inside| inside.leave.same_channel(&self.leave);
        state.inside.retain(|inside| !here(inside));
        let (number, visitor) = (self.number, self.visitor.clone());
        state.tell(DoorEvent::Left(number, visitor));
    }
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
        // Whose connection breaks comes in again, however many have come and gone since they did.
        let inside: Vec<Who> = (state.inside.iter())
            .filter_map(|inside| inside.visitor.who())
            .collect();
        for who in inside {
            keep(&mut state.rules.admitted, who);
        }
        state.rules.locked
    }

    /// Notes that a guest has a link, with a token that the server calls `token`.
    pub fn invite(&self, guest: Guest, token: Name) {
        let mut state = self.locked();
        let who = Who::Guest(guest.clone());
        state.rules.removed.retain(|removed| *removed != who);
        keep(&mut state.rules.invited, (guest, token));
    }

    /// Lets in whoever of this number waits, also if the same key was sent away meanwhile with another link. Who they are.
    pub fn admit(&self, number: u32) -> Option<Visitor> {
        let mut state = self.locked();
        let waits = state
            .waiting
            .iter()
            .position(|waiting| waiting.number == number)?;
        let Waiting { who, visitor, .. } = state.waiting.remove(waits);
        state.rules.removed.retain(|removed| *removed != who);
        keep(&mut state.rules.admitted, who);
        Some(visitor)
    }

    /// Sends away whoever has this number: who waits, or is inside; they do not come in again, neither by another link. Who they are.
    pub fn remove(&self, number: u32) -> Option<Visitor> {
        let mut state = self.locked();
        let seen = state
            .seen()
            .into_iter()
            .find(|seen| seen.number == number)?;
        let visitor = seen.visitor;
        state.waiting.retain(|waiting| waiting.number != number);
        for inside in state.inside.iter().filter(|inside| inside.number == number) {
            inside.leave.send_replace(true);
        }
        let handed_over = state.handed_over.iter();
        let sessions = handed_over.filter(|viewer| viewer.number == number);
        let sessions: Vec<Name> = sessions.map(|viewer| viewer.session.clone()).collect();
        state.handed_over.retain(|viewer| viewer.number != number);
        state.to_end.extend(sessions);
        for who in visitor.all_that_it_is() {
            state.rules.admitted.retain(|admitted| *admitted != who);
            keep(&mut state.rules.removed, who);
        }
        self.0.changed.notify_one();
        Some(visitor)
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

    /// A viewer wants to come in: whether it may, and if not, what it is answered. `now` is seconds since 1970.
    pub(crate) fn knock(&self, visitor: &Visitor, now: u64) -> Result<(), Refusal> {
        let mut state = self.locked();
        state.forget_who_gave_up();
        if state.rules.has_removed(visitor) {
            return Err(Refusal::Removed);
        }
        let rules = &state.rules;
        match &visitor.guest {
            Some(guest) if guest.expires <= now => return Err(Refusal::Expired),
            None if rules.guests_only => return Err(Refusal::Guests),
            _ => {}
        }
        let who = visitor.who();
        if who.as_ref().is_some_and(|who| rules.admitted.contains(who)) {
            return Ok(());
        }
        if rules.locked {
            return Err(Refusal::Locked);
        }
        match who {
            None if rules.ask => Err(Refusal::Nameless),
            None => Ok(()),
            Some(who) if rules.ask => Err(state.wait(who, visitor)),
            Some(who) => {
                keep(&mut state.rules.admitted, who);
                Ok(())
            }
        }
    }

    /// A viewer is connected.
    pub(crate) fn enter(&self, visitor: Visitor) -> Stay {
        let leave = watch::Sender::new(false);
        let mut state = self.locked();
        let number = state.number_of(&visitor);
        // Removed between its answer and its connection.
        if state.rules.has_removed(&visitor) {
            leave.send_replace(true);
        }
        state.tell(DoorEvent::Entered(number, visitor.clone()));
        state.inside.push(Inside {
            number,
            visitor: visitor.clone(),
            leave: leave.clone(),
        });
        Stay {
            door: self.clone(),
            number,
            visitor,
            leave,
        }
    }

    /// A viewer is handed over to the server.
    pub(crate) fn hand_over(&self, visitor: Visitor, session: Name) {
        let mut state = self.locked();
        let number = state.number_of(&visitor);
        if state.handed_over.len() == MOST_HANDED_OVER {
            state.handed_over.pop_front();
        }
        state.handed_over.push_back(HandedOver {
            number,
            visitor,
            session,
        });
    }

    /// The server says that this session has ended.
    pub(crate) fn left(&self, session: &Name) {
        let mut state = self.locked();
        state
            .handed_over
            .retain(|viewer| viewer.session != *session);
    }

    /// Waits until something has to be said to the server.
    pub(crate) async fn changed(&self) {
        self.0.changed.notified().await;
    }

    /// The sessions that the server is to end, once each.
    pub(crate) fn take_sessions_to_end(&self) -> Vec<Name> {
        std::mem::take(&mut self.locked().to_end)
    }

    /// The tokens of guests who were sent away, the newest, `most` at most.
    pub(crate) fn revoked(&self, most: usize) -> Vec<Name> {
        let state = self.locked();
        let DoorRules {
            removed, invited, ..
        } = &state.rules;
        let is_removed = |guest: &Guest| removed.contains(&Who::Guest(guest.clone()));
        let revoked = invited.iter().rev().filter(|(guest, _)| is_removed(guest));
        revoked.map(|(_, token)| token.clone()).take(most).collect()
    }

    fn locked(&self) -> MutexGuard<'_, State> {
        // Nothing in here is half-changed after a panic elsewhere.
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn tell(&mut self, event: DoorEvent) {
        if self.events.len() == MOST_EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    fn seen(&self) -> Vec<Seen> {
        let waiting =
            (self.waiting.iter()).map(|waiting| (waiting.number, &waiting.visitor, true, false));
        let inside =
            (self.inside.iter()).map(|inside| (inside.number, &inside.visitor, false, false));
        let handed_over =
            (self.handed_over.iter()).map(|viewer| (viewer.number, &viewer.visitor, false, true));
        let all = waiting.chain(inside).chain(handed_over);
        let all = all.map(|(number, visitor, waits, handed_over)| Seen {
            number,
            visitor: visitor.clone(),
            waits,
            handed_over,
        });
        all.collect()
    }

    /// The number of a visitor who was seen already, or a new one.
    fn number_of(&mut self, visitor: &Visitor) -> u32 {
        let who = visitor.who();
        let known = |(known, _): &&(Who, u32)| Some(known) == who.as_ref();
        if let Some((_, number)) = self.numbered.iter().find(known) {
            return *number;
        }
        self.numbers = self.numbers.wrapping_add(1);
        if let Some(who) = who {
            keep(&mut self.numbered, (who, self.numbers));
        }
        self.numbers
    }

    /// Notes that someone waits; what they are answered.
    fn wait(&mut self, who: Who, visitor: &Visitor) -> Refusal {
        let now = Instant::now();
        if let Some(waiting) = self.waiting.iter_mut().find(|waiting| waiting.who == who) {
            waiting.knocked = now;
            return Refusal::Wait;
        }
        // Who cannot wait here yet may try again all the same.
        if self.waiting.len() < MOST_WAITING {
            let number = self.number_of(visitor);
            self.waiting.push(Waiting {
                number,
                who,
                visitor: visitor.clone(),
                knocked: now,
            });
            self.tell(DoorEvent::Waits(number, visitor.clone()));
        }
        Refusal::Wait
    }

    fn forget_who_gave_up(&mut self) {
        let gone = |waiting: &Waiting| waiting.knocked.elapsed() > GIVEN_UP;
        let gone: Vec<Waiting> = self
            .waiting
            .extract_if(.., |waiting| gone(waiting))
            .collect();
        for Waiting {
            number, visitor, ..
        } in gone
        {
            self.tell(DoorEvent::GaveUp(number, visitor));
        }
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
mod tests {
    use super::*;
    use identity::Identity;
    use link_protocol::Rights;

    fn keyed(seed: u8) -> Visitor {
        let identity = Identity::from_seed(&[seed; 32]).expect("a key");
        Visitor {
            key: Some(identity.public()),
            guest: None,
        }
    }

    fn guest(name: &str, expires: u64) -> Visitor {
        Visitor {
            key: None,
            guest: Some(Guest {
                name: name.parse().expect("a name"),
                expires,
                rights: Rights::ALL,
            }),
        }
    }

    /// In the year 2096.
    const LATE: u64 = 4_000_000_000;

    const NAMELESS: Visitor = Visitor {
        key: None,
        guest: None,
    };

    fn asking() -> Door {
        Door::new(DoorRules {
            ask: true,
            ..DoorRules::default()
        })
    }

    #[tokio::test]
    async fn who_is_asked_about_waits_is_let_in_comes_back_and_may_give_up() {
        let door = asking();
        let (ada, bob) = (keyed(1), keyed(2));
        assert_eq!(door.knock(&NAMELESS, 0), Err(Refusal::Nameless));
        assert_eq!(door.knock(&ada, 0), Err(Refusal::Wait));
        assert_eq!(door.knock(&ada, 0), Err(Refusal::Wait), "still");
        assert_eq!(door.knock(&bob, 0), Err(Refusal::Wait));
        assert_eq!(door.next_event(), Some(DoorEvent::Waits(1, ada.clone())));
        assert_eq!(door.next_event(), Some(DoorEvent::Waits(2, bob.clone())));
        assert_eq!(door.next_event(), None, "each is told once");
        assert_eq!(door.admit(1), Some(ada.clone()));
        assert_eq!(door.knock(&ada, 0), Ok(()));
        let stay = door.enter(ada.clone());
        drop(stay);
        assert_eq!(door.knock(&ada, 0), Ok(()), "comes back");
        for waiting in &mut door.locked().waiting {
            waiting.knocked -= GIVEN_UP + Duration::from_millis(1);
        }
        let events: Vec<_> = std::iter::from_fn(|| door.next_event()).collect();
        assert_eq!(
            events,
            [
                DoorEvent::Entered(1, ada.clone()),
                DoorEvent::Left(1, ada),
                DoorEvent::GaveUp(2, bob),
            ]
        );
        assert_eq!(door.admit(2), None, "nobody waits");
        for seed in (10..).take(MOST_WAITING + 5) {
            assert_eq!(door.knock(&keyed(seed), 0), Err(Refusal::Wait));
        }
        assert_eq!(door.seen().len(), MOST_WAITING, "bounded");
    }

    #[tokio::test]
    async fn who_is_sent_away_leaves_and_does_not_come_in_by_another_link() {
        let door = Door::default();
        let bob = Visitor {
            key: keyed(2).key,
            ..guest("Bob", LATE)
        };
        let token: Name = "t".parse().expect("a name");
        door.invite(bob.guest.clone().expect("a guest"), token.clone());
        assert_eq!(door.knock(&bob, 0), Ok(()));
        let stay = door.enter(bob.clone());
        door.hand_over(bob.clone(), "s1".parse().expect("a name"));
        let number = door.seen()[0].number;
        assert!(door.revoked(9).is_empty());
        assert_eq!(door.remove(number), Some(bob.clone()));
        assert_eq!(
            Stay::over(Some(&stay)).await,
            "the performer has sent it away"
        );
        door.changed().await;
        assert_eq!(door.take_sessions_to_end(), ["s1".parse().expect("a name")]);
        assert_eq!(door.revoked(9), [token]);
        for visitor in [&bob, &guest("Bob", LATE), &keyed(2)] {
            assert_eq!(door.knock(visitor, 0), Err(Refusal::Removed), "{visitor}");
        }
        // Another link for a longer time is another decision, but the key stays out.
        assert_eq!(door.knock(&guest("Bob", LATE + 1), 0), Ok(()));
        let again = Door::new(door.rules());
        assert_eq!(again.knock(&bob, 0), Err(Refusal::Removed), "kept");
    }

    #[tokio::test]
    async fn a_locked_room_lets_those_in_who_were_inside_and_guests_come_until_their_time_is_over()
    {
        let door = Door::default();
        assert_eq!(door.knock(&keyed(1), 0), Ok(()));
        let _stay = door.enter(keyed(1));
        // However many come after.
        for seed in 0..=u8::MAX {
            let mut bytes = [7; 32];
            bytes[0] = seed;
            let identity = Identity::from_seed(&bytes).expect("a key");
            let visitor = Visitor {
                key: Some(identity.public()),
                guest: None,
            };
            assert_eq!(door.knock(&visitor, 0), Ok(()));
        }
        assert!(door.toggle_lock());
        assert_eq!(door.knock(&keyed(1), 0), Ok(()), "was inside");
        assert_eq!(door.knock(&keyed(99), 0), Err(Refusal::Locked));
        assert_eq!(door.knock(&NAMELESS, 0), Err(Refusal::Locked));
        assert!(!door.toggle_lock());
        let door = Door::new(DoorRules {
            guests_only: true,
            ..DoorRules::default()
        });
        assert_eq!(door.knock(&keyed(1), 0), Err(Refusal::Guests));
        assert_eq!(door.knock(&guest("Bob", 10), 9), Ok(()));
        assert_eq!(door.knock(&guest("Bob", 10), 10), Err(Refusal::Expired));
        // Long over by the clock.
        let stay = door.enter(guest("Bob", 10));
        assert_eq!(Stay::over(Some(&stay)).await, "its link has ended");
        let stay = door.enter(guest("Bob", u64::MAX));
        let lasts = tokio::time::timeout(Duration::from_millis(50), Stay::over(Some(&stay)));
        assert!(lasts.await.is_err(), "goes on");
    }
}
