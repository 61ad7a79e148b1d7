//! What a performer has decided at the door of a room, and what follows from it for one who comes.

use super::keep;
use crate::CallError;
use crate::visitor::{Visitor, Who};
use link_protocol::{Guest, Name, Refusal};

/// Guests whose links hold at once.
const MOST_INVITED: usize = super::MOST_KEPT;

/// What the performer has decided, so that it can be kept for the next time.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct DoorRules {
    /// Each newcomer waits until the performer lets them in.
    pub ask: bool,
    /// Only guests come in, each by a link of their own.
    pub guests_only: bool,
    /// Nobody comes in who was not inside before.
    pub locked: bool,
    /// Nobody comes in without a key or a guest's link: one who had neither was sent away, and could not be told from another.
    pub known_only: bool,
    /// Whom the performer let in, and who come in again unasked.
    pub admitted: Vec<Who>,
    /// Who was inside, and comes in again although the room is locked.
    pub entered: Vec<Who>,
    /// Who was sent away, and does not come in again.
    pub removed: Vec<Who>,
    /// The guests who were made a link.
    pub invited: Vec<Guest>,
}

/// What follows from the rules for one who wants to come in.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// They come in.
    Enters,
    /// The performer is to be asked.
    Asked(Who),
    /// They do not come in.
    Refused(Refusal),
}

impl DoorRules {
    /// Whether any of what this visitor is was sent away.
    pub(super) fn has_removed(&self, visitor: &Visitor) -> bool {
        let mut all = visitor.identities();
        all.any(|who| self.removed.contains(&who))
    }

    /// What follows for `visitor`, who offers with the token that the server calls `token`. `now` is seconds since 1970.
    pub(super) fn verdict(&self, visitor: &Visitor, token: Option<&Name>, now: u64) -> Verdict {
        use Verdict::{Asked, Enters, Refused};
        if self.has_removed(visitor) {
            return Refused(Refusal::Removed);
        }
        match &visitor.guest {
            // A guest's line and token belong together: with either alone someone would have other rights than their link gives.
            Some(guest) if Some(&guest.token) != token => return Refused(Refusal::Link),
            None if self.is_guests(token) => return Refused(Refusal::Link),
            Some(guest) if guest.expires <= now => return Refused(Refusal::Expired),
            None if self.guests_only => return Refused(Refusal::Guests),
            _ => {}
        }
        let who = visitor.who();
        let is_in = |all: &[Who]| who.as_ref().is_some_and(|who| all.contains(who));
        if is_in(&self.admitted) {
            return Enters;
        }
        if self.locked && (self.ask || !is_in(&self.entered)) {
            return Refused(Refusal::Locked);
        }
        match who {
            None if self.ask || self.known_only => Refused(Refusal::Nameless),
            Some(who) if self.ask => Asked(who),
            _ => Enters,
        }
    }

    /// Whether the token of this name is in a guest's link.
    fn is_guests(&self, token: Option<&Name>) -> bool {
        token.is_some_and(|token| self.invited.iter().any(|guest| guest.token == *token))
    }

    /// Notes that a guest has a link.
    pub(super) fn invite(&mut self, guest: Guest, now: u64) -> Result<(), CallError> {
        self.invited.retain(|guest| guest.expires > now);
        if self.invited.len() >= MOST_INVITED {
            return Err(CallError::TooManyGuests { most: MOST_INVITED });
        }
        keep(&mut self.invited, guest);
        Ok(())
    }

    /// Lets `who` in from now on, also if they were sent away.
    pub(super) fn admit(&mut self, who: Who) {
        self.removed.retain(|removed| *removed != who);
        keep(&mut self.admitted, who);
    }

    /// Keeps `visitor` out from now on, by whatever it may be known.
    pub(super) fn remove(&mut self, visitor: &Visitor) {
        self.known_only |= visitor.who().is_none();
        for who in visitor.identities() {
            self.admitted.retain(|admitted| *admitted != who);
            self.entered.retain(|entered| *entered != who);
            keep(&mut self.removed, who);
        }
    }

    /// The tokens of the guests who were sent away and whose links would hold still, the newest, `most` at most.
    pub(super) fn revoked(&self, most: usize, now: u64) -> Vec<Name> {
        let guests = self.removed.iter().rev().filter_map(|who| match who {
            Who::Guest(guest) if guest.expires > now => Some(guest.token.clone()),
            _ => None,
        });
        guests.take(most).collect()
    }
}
