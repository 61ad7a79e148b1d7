//! Error responses.

use super::{Service, unix_now};
use crate::allocation::{Client, Refused};
use crate::credentials::REALM;
use crate::message::{Message, Writer, attribute, kind};
use crate::table::Full;

/// A request's error response.
#[derive(Debug)]
pub(super) struct Refusal {
    pub(super) code: u16,
    pub(super) reason: &'static str,
}

pub(super) const BAD_REQUEST: Refusal = refusal(400, "Bad Request");
pub(super) const UNAUTHORIZED: Refusal = refusal(401, "Unauthorized");
pub(super) const FORBIDDEN: Refusal = refusal(403, "Forbidden");
pub(super) const UNKNOWN_ATTRIBUTE: Refusal = refusal(420, "Unknown Attribute");
pub(super) const MISMATCH: Refusal = refusal(437, "Allocation Mismatch");
pub(super) const STALE_NONCE: Refusal = refusal(438, "Stale Nonce");
pub(super) const FAMILY: Refusal = refusal(440, "Address Family not Supported");
pub(super) const WRONG_CREDENTIALS: Refusal = refusal(441, "Wrong Credentials");
pub(super) const TRANSPORT: Refusal = refusal(442, "Unsupported Transport Protocol");
pub(super) const PEER_FAMILY: Refusal = refusal(443, "Peer Address Family Mismatch");
pub(super) const QUOTA: Refusal = refusal(486, "Allocation Quota Reached");
pub(super) const NO_CAPACITY: Refusal = refusal(508, "Insufficient Capacity");

const fn refusal(code: u16, reason: &'static str) -> Refusal {
    Refusal { code, reason }
}

impl From<Refused> for Refusal {
    fn from(refused: Refused) -> Self {
        match refused {
            Refused::TooMany => NO_CAPACITY,
            Refused::Mismatch => BAD_REQUEST,
        }
    }
}

impl Service {
    /// The refusal of an allocation, which is counted.
    pub(super) fn full(&self, full: Full) -> Refusal {
        log::debug!("an allocation is refused: {full}");
        self.count(|counts| match full {
            Full::Server => &mut counts.refused_by_server,
            Full::Owner => &mut counts.refused_by_owner,
            Full::Room => &mut counts.refused_by_room,
            Full::Token => &mut counts.refused_by_token,
            Full::Address => &mut counts.refused_by_address,
        });
        match full {
            Full::Server | Full::Owner => NO_CAPACITY,
            Full::Room | Full::Token | Full::Address => QUOTA,
        }
    }

    /// An error response; one that asks for credentials carries the realm and a nonce.
    pub(super) fn refuse(
        &self,
        client: Client,
        message: &Message<'_>,
        refusal: &Refusal,
        key: Option<&[u8]>,
    ) -> Vec<u8> {
        let mut answer = Writer::new(message.kind() | kind::ERROR, message.transaction())
            .error(refusal.code, refusal.reason);
        match refusal.code {
            401 | 438 => {
                let nonce = self.nonce(unix_now(), client);
                answer = answer
                    .add(attribute::REALM, REALM.as_bytes())
                    .add(attribute::NONCE, nonce.as_bytes());
            }
            420 => {
                let unknown: Vec<u8> = message
                    .not_understood()
                    .iter()
                    .flat_map(|kind| kind.to_be_bytes())
                    .collect();
                answer = answer.add(attribute::UNKNOWN_ATTRIBUTES, &unknown);
            }
            _ => {}
        }
        match key {
            Some(key) => answer.signed(key).finish(),
            None => answer.finish(),
        }
    }
}
