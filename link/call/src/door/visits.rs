//! Who waits at a door, who is inside, and who was handed over to the server.

use super::places::to_make_room;
use super::{DoorEvent, DoorRules, MOST_EVENTS, Seen, keep};
use crate::visitor::{Visitor, Who};
use link_protocol::{Name, Refusal};
use std::collections::VecDeque;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::Instant;

/// A viewer that waits offers again and again; one that does not for so long has given up.
pub(super) const GIVEN_UP: Duration = Duration::from_secs(8);

/// Visitors without a guest's link that wait at once: whoever has the room's link may make keys as they like. Guests always find room.
pub(super) const MOST_WAITING: usize = 32;

/// Between two lines about visitors who find no room to wait.
const CROWDED_APART: Duration = Duration::from_secs(30);

/// Viewers handed over to the server that may be there at once, or are on their way there.
pub(super) const MOST_HANDED_OVER: usize = 1024;

#[derive(Debug, Default)]
pub(super) struct State {
    pub(super) rules: DoorRules,
    /// The last number that was given, and to whom.
    numbers: u32,
    numbered: Vec<(Who, u32)>,
    pub(super) waiting: Vec<Waiting>,
    pub(super) inside: Vec<Inside>,
    handed_over: Vec<HandedOver>,
    /// Sessions that the server is to end.
    pub(super) to_end: Vec<Name>,
    pub(super) events: VecDeque<DoorEvent>,
    crowded: Option<Instant>,
}

#[derive(Debug)]
pub(super) struct Waiting {
    pub(super) number: u32,
    who: Who,
    visitor: Visitor,
    pub(super) knocked: Instant,
}

#[derive(Debug)]
pub(super) struct Inside {
    pub(super) number: u32,
    pub(super) visitor: Visitor,
    /// What the server calls the network that they come from.
    pub(super) network: Option<Name>,
    pub(super) leave: watch::Sender<Option<&'static str>>,
}

impl Inside {
    /// Has them leave, for the first reason there is.
    pub(super) fn send_away(&self, why: &'static str) {
        self.leave.send_if_modified(|leave| {
            let is_first = leave.is_none();
            leave.get_or_insert(why);
            is_first
        });
    }
}

#[derive(Debug)]
struct HandedOver {
    number: u32,
    visitor: Visitor,
    session: Name,
}

impl State {
    pub(super) fn tell(&mut self, event: DoorEvent) {
        if self.events.len() == MOST_EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    pub(super) fn seen(&self) -> Vec<Seen> {
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
    pub(super) fn number_of(&mut self, visitor: &Visitor) -> u32 {
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

    /// Who makes room for `newcomer`, who comes from `network`, where all places are taken.
    pub(super) fn makes_room(&self, newcomer: &Visitor, network: Option<&Name>) -> Option<&Inside> {
        let inside: Vec<&Inside> = (self.inside.iter())
            .filter(|inside| inside.leave.borrow().is_none())
            .collect();
        let from: Vec<_> = (inside.iter())
            .map(|inside| (inside.network.as_ref(), inside.visitor.key))
            .collect();
        let at = to_make_room(&from, &(network, newcomer.key))?;
        inside.get(at).copied()
    }

    /// Viewers that are inside and do not have to go.
    pub(super) fn stay(&self) -> usize {
        let stays = |inside: &&Inside| inside.leave.borrow().is_none();
        self.inside.iter().filter(stays).count()
    }

    /// Notes that someone waits; what they are answered.
    pub(super) fn wait(&mut self, who: Who, visitor: &Visitor) -> Refusal {
        let now = Instant::now();
        if let Some(waiting) = self.waiting.iter_mut().find(|waiting| waiting.who == who) {
            waiting.knocked = now;
            return Refusal::Wait;
        }
        let is_key = |who: &Who| matches!(who, Who::Key(_));
        let keys = self.waiting.iter().filter(|waiting| is_key(&waiting.who));
        if is_key(&who) && keys.count() >= MOST_WAITING {
            // They may try again all the same.
            if self
                .crowded
                .is_none_or(|told| told.elapsed() >= CROWDED_APART)
            {
                self.crowded = Some(now);
                self.tell(DoorEvent::Crowded);
            }
            return Refusal::Wait;
        }
        let number = self.number_of(visitor);
        self.waiting.push(Waiting {
            number,
            who,
            visitor: visitor.clone(),
            knocked: now,
        });
        self.tell(DoorEvent::Waits(number, visitor.clone()));
        Refusal::Wait
    }

    /// Who waited with this number, and waits no longer.
    pub(super) fn take_waiting(&mut self, number: u32) -> Option<(Who, Visitor)> {
        let at = (self.waiting.iter()).position(|waiting| waiting.number == number)?;
        let Waiting { who, visitor, .. } = self.waiting.remove(at);
        Some((who, visitor))
    }

    pub(super) fn forget_who_gave_up(&mut self) {
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

    /// Whether there is room for one more.
    pub(super) fn hand_over(&mut self, visitor: Visitor, session: Name) -> bool {
        if self.handed_over.len() >= MOST_HANDED_OVER || self.rules.has_removed(&visitor) {
            return false;
        }
        let number = self.number_of(&visitor);
        self.note_entered(&visitor);
        self.handed_over.push(HandedOver {
            number,
            visitor,
            session,
        });
        true
    }

    pub(super) fn left(&mut self, session: &Name) {
        let gone = |viewer: &HandedOver| viewer.session == *session;
        self.handed_over.retain(|viewer| !gone(viewer));
    }

    /// Has the server end the sessions of those whom it serves and `has_to_go` says have to go; whether there were any.
    pub(super) fn end_handed_over(&mut self, has_to_go: impl Fn(u32, &Visitor) -> bool) -> bool {
        let gone = self
            .handed_over
            .extract_if(.., |viewer| has_to_go(viewer.number, &viewer.visitor));
        let before = self.to_end.len();
        self.to_end.extend(gone.map(|viewer| viewer.session));
        self.to_end.len() > before
    }

    /// Notes that someone is or was inside.
    pub(super) fn note_entered(&mut self, visitor: &Visitor) {
        if let Some(who) = visitor.who() {
            keep(&mut self.rules.entered, who);
        }
    }

    /// Keeps those who are inside as the newest of those who were: however many have come and gone since, whose connection breaks comes in again.
    pub(super) fn note_who_is_inside(&mut self) {
        let inside = self.inside.iter().map(|inside| &inside.visitor);
        let handed_over = self.handed_over.iter().map(|viewer| &viewer.visitor);
        let all: Vec<Who> = handed_over.chain(inside).filter_map(Visitor::who).collect();
        for who in all {
            keep(&mut self.rules.entered, who);
        }
    }
}
