//! Who may ask: credentials limited in time, and nonces that the server need not keep.

use super::refusal::{BAD_REQUEST, Refusal, STALE_NONCE, UNAUTHORIZED, WRONG_CREDENTIALS};
use super::{Service, unix_now};
use crate::allocation::Client;
use crate::credentials::{Name, REALM, hmac};
use crate::message::{Message, attribute};
use hmac::Mac;

/// How long a nonce is good.
const NONCE_LIFETIME: u64 = 3600;

/// Who sent an authenticated request.
pub(super) struct Bearer<'a> {
    pub(super) username: &'a str,
    pub(super) name: Name<'a>,
    pub(super) key: [u8; 16],
}

impl Service {
    /// Who sent a request, if its credentials are genuine, fresh, and those of its allocation.
    pub(super) fn authenticate<'a>(
        &self,
        client: Client,
        message: &Message<'a>,
    ) -> Result<Bearer<'a>, Refusal> {
        if !message.has_integrity() {
            return Err(UNAUTHORIZED);
        }
        let username = message.text(attribute::USERNAME).ok_or(BAD_REQUEST)?;
        let realm = message.text(attribute::REALM).ok_or(BAD_REQUEST)?;
        let nonce = message.text(attribute::NONCE).ok_or(BAD_REQUEST)?;
        if !self.is_fresh(nonce, client) {
            return Err(STALE_NONCE);
        }
        let name = Name::read(username).ok_or(UNAUTHORIZED)?;
        let key = self.config.key.long_term(username).ok_or(UNAUTHORIZED)?;
        if realm != REALM || !message.verify(&key) {
            return Err(UNAUTHORIZED);
        }
        let allocation = self.allocation(client);
        let subject = name.subject;
        if !(self.config.admission).honours(subject.room, subject.tokens) {
            self.count(|counts| &mut counts.revoked);
            if let Some(allocation) = allocation {
                allocation.ended.cancel();
            }
            return Err(UNAUTHORIZED);
        }
        match allocation {
            // An allocation lives on with the credentials that made it; they allow no other.
            Some(allocation) if allocation.terms.username != username => {
                return Err(WRONG_CREDENTIALS);
            }
            Some(_) => {}
            None if name.expires <= unix_now() => return Err(UNAUTHORIZED),
            None => {}
        }
        Ok(Bearer {
            username,
            name,
            key,
        })
    }

    /// A nonce that only this client can use, without the server keeping it.
    pub(super) fn nonce(&self, time: u64, client: Client) -> String {
        let tag = hmac(
            &self.nonce_key,
            format!("{time} {}", client.address).as_bytes(),
        )
        .finalize()
        .into_bytes();
        let tag: String = tag
            .iter()
            .take(8)
            .map(|byte| format!("{byte:02x}"))
            .collect();
        format!("{time:x}-{tag}")
    }

    fn is_fresh(&self, nonce: &str, client: Client) -> bool {
        let time = nonce.split('-').next();
        let time = time.and_then(|time| u64::from_str_radix(time, 16).ok());
        time.is_some_and(|time| {
            // A nonce is no secret: anyone may ask for one.
            nonce == self.nonce(time, client) && unix_now().saturating_sub(time) < NONCE_LIFETIME
        })
    }
}
