//! Whom the relay admits: bearers whose tokens hold, from addresses that are not blocked.

use crate::Id;
use crate::blocked::Blocked;
use crate::revoked::Revoked;
use crate::rooms::Rooms;
use std::net::IpAddr;
use std::sync::Arc;

/// What the server knows of tokens and addresses.
#[derive(Debug)]
pub(crate) struct Admission {
    pub(crate) revoked: Arc<Revoked>,
    pub(crate) blocked: Arc<Blocked>,
    pub(crate) rooms: Arc<Rooms>,
}

impl turn_server::Admission for Admission {
    fn honours(&self, room: &str, tokens: &str) -> bool {
        let mut names = tokens.split('.').filter_map(Id::parse);
        if self.revoked.has_any(names.clone()) {
            return false;
        }
        // A sender may have revoked a guest's own token.
        let sender = Id::parse(room).and_then(|room| self.rooms.presence(room));
        !sender.is_some_and(|sender| sender.has_revoked(names.next()))
    }

    fn is_blocked(&self, address: IpAddr) -> bool {
        self.blocked.has(address)
    }
}
