//! Which sessions came about by which tokens, so that they end with these. Forgotten where the server restarts: what is connected then goes on.

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
            sessions.pop_front();
        }
        sessions.push_back(Session {
            room,
            session,
            claims: *claims,
        });
    }

    /// Takes out the sessions of which `is_over` says that a token of these names holds no longer: their rooms and names.
    pub(super) fn take(
        &self,
        is_over: impl Fn(&mut dyn Iterator<Item = Id>) -> bool,
    ) -> Vec<(Id, Id)> {
        let mut taken = Vec::new();
        let mut owners = self.locked();
        for sessions in owners.values_mut() {
            sessions.retain(|session| {
                let is_over = is_over(&mut session.claims.names());
                if is_over {
                    taken.push((session.room, session.session));
                }
                !is_over
            });
        }
        owners.retain(|_, sessions| !sessions.is_empty());
        taken
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
            move |names: &mut dyn Iterator<Item = Id>| names.any(|name| name == claims.name)
        };
        assert_eq!(joined.take(of(eve)).len(), PER_OWNER);
        assert_eq!(joined.take(of(ada)), [(room, first)]);
        assert!(joined.locked().is_empty());
        joined.add(&ada, room, first, 0);
        joined.forget_over(10);
        assert!(joined.locked().is_empty());
        Ok(())
    }
}
