//! Which sessions came about by which tokens, so that they end with these. Forgotten where the server restarts: what is
//! connected then goes on.

use crate::Id;
use crate::token::Claims;
use std::collections::{HashMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Sessions that are kept of one owner's rooms, the newest.
const PER_OWNER: usize = 4096;

/// The sessions, by the owner of their room.
#[derive(Debug, Default)]
pub(crate) struct Joined(Mutex<HashMap<Id, VecDeque<Session>>>);

/// A viewer's session.
#[derive(Clone, Copy, Debug)]
struct Session {
    room: Id,
    session: Id,
    claims: Claims,
    /// It was found that its token holds no longer.
    is_over: bool,
}

impl Joined {
    /// Keeps a session that began by the token of these claims.
    pub(super) fn add(&self, claims: &Claims, room: Id, session: Id, now: u64) {
        let mut owners = self.locked();
        let sessions = owners.entry(claims.owner).or_default();
        if sessions.len() >= PER_OWNER {
            sessions.retain(|session| session.claims.expires > now);
        }
        if sessions.len() >= PER_OWNER {
            // The oldest one of the token with the most: a viewer with many sessions has none of another's forgotten.
            let mut counts = HashMap::<Id, usize>::new();
            for session in sessions.iter() {
                *counts.entry(session.claims.name).or_default() += 1;
            }
            let most = counts.into_iter().max_by_key(|(_, count)| *count);
            let at = most.and_then(|(name, _)| {
                let is_its = |session: &Session| session.claims.name == name;
                sessions.iter().position(is_its)
            });
            sessions.remove(at.unwrap_or(0));
        }
        sessions.push_back(Session {
            room,
            session,
            claims: *claims,
            is_over: false,
        });
    }

    /// The sessions of which `is_over` says for the first time that a token of these names holds no longer: their rooms
    /// and names.
    pub(super) fn newly_over(
        &self,
        is_over: impl Fn(&mut dyn Iterator<Item = Id>) -> bool,
    ) -> Vec<(Id, Id)> {
        let mut over = Vec::new();
        for session in self.locked().values_mut().flatten() {
            if !session.is_over && is_over(&mut session.claims.names()) {
                session.is_over = true;
                over.push((session.room, session.session));
            }
        }
        over
    }

    /// The sessions of a room of this owner's, the newest last.
    pub(super) fn of_room(&self, owner: Id, room: Id) -> Vec<Id> {
        let owners = self.locked();
        let sessions = owners.get(&owner).into_iter().flatten();
        let sessions = sessions.filter(|session| session.room == room);
        sessions.map(|session| session.session).collect()
    }

    /// Forgets sessions whose token has expired.
    pub(crate) fn forget_over(&self, now: u64) {
        let mut owners = self.locked();
        for sessions in owners.values_mut() {
            sessions.retain(|session| session.claims.expires > now);
        }
        owners.retain(|_, sessions| !sessions.is_empty());
    }

    fn locked(&self) -> MutexGuard<'_, HashMap<Id, VecDeque<Session>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::token::Role;

    #[test]
    fn the_newest_sessions_of_each_owner_are_kept_until_their_token_is_over()
    -> Result<(), Box<dyn std::error::Error>> {
        let joined = Joined::default();
        let room = Id::random()?;
        let viewer = |owner: &str, expires| {
            Claims::in_room(Role::Viewer, Id::of_owner(owner), room, expires)
        };
        let (ada, eve) = (viewer("ada", 10)?, viewer("eve", 20)?);
        let first = Id::random()?;
        joined.add(&ada, room, first, 0);
        for _ in 0..PER_OWNER + 10 {
            joined.add(&eve, room, Id::random()?, 0);
        }
        let of = |claims: Claims| {
            move |names: &mut dyn Iterator<Item = Id>| {
                std::iter::from_fn(|| names.next()).any(|name| name == claims.name)
            }
        };
        assert_eq!(joined.newly_over(of(eve)).len(), PER_OWNER);
        assert_eq!(joined.newly_over(of(ada)), [(room, first)]);
        assert_eq!(joined.newly_over(of(ada)), [], "once");
        assert_eq!(joined.of_room(ada.owner, room), [first]);
        assert_eq!(joined.of_room(ada.owner, first), [], "another room");
        joined.forget_over(10);
        assert_eq!(joined.of_room(ada.owner, room), [], "expired");
        joined.forget_over(20);
        assert!(joined.locked().is_empty());
        Ok(())
    }
}
