//! The JSON bodies about calls of several: opening one, and who is in it.

use crate::limits::MAX_MEMBER_PROOF;
use crate::{Announcement, IceServers, Name, PersonName};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The body of the request that opens a call.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct OpenCall {
    /// How long the members' token is valid, seconds; the server's choice where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lifetime_s: Option<u64>,
    /// How many seats one network address may take, 1 to [`MAX_PEOPLE`](crate::limits::MAX_PEOPLE);
    /// [`SEATS_PER_ADDRESS`](crate::limits::SEATS_PER_ADDRESS) where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seats_per_address: Option<u8>,
}

/// What a member shows the other members by way of the server: that it has the call's link, and its key with a
/// signature. The server passes it on unread.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct MemberProof(String);

impl MemberProof {
    /// The lines, as they are in an offer or answer.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for MemberProof {
    type Error = &'static str;

    fn try_from(lines: String) -> Result<Self, Self::Error> {
        let is_text = |byte: u8| byte.is_ascii_graphic() || b" \r\n".contains(&byte);
        if lines.len() > MAX_MEMBER_PROOF || !lines.bytes().all(is_text) {
            return Err("a member's proof is 512 characters of ASCII at most");
        }
        Ok(Self(lines))
    }
}

impl From<MemberProof> for String {
    fn from(proof: MemberProof) -> Self {
        proof.0
    }
}

/// The answer to [`OpenCall`]. Its [`Debug`] hides the token.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OpenedCall {
    /// The call's name.
    pub call: Name,
    /// The token of everyone who joins it.
    pub member_token: String,
    /// When it expires, Unix seconds.
    pub expires: u64,
}

impl fmt::Debug for OpenedCall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OpenedCall")
            .field("call", &self.call)
            .field("expires", &self.expires)
            .finish_non_exhaustive()
    }
}

/// The seats of a call, always in the same order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CallStatus {
    /// All of them, [`MAX_PEOPLE`](crate::limits::MAX_PEOPLE) at most.
    pub seats: Vec<Seat>,
    /// The STUN and TURN servers, with credentials for the call; a viewer of a seat is told those of the seat.
    #[serde(default, skip_serializing_if = "IceServers::is_empty")]
    pub ice_servers: IceServers,
}

/// A seat of a call: a room in which one person at a time is the sender.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Seat {
    /// The room's name.
    pub room: Name,
    /// Who is there; nothing where it is free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taken: Option<Taken>,
    /// Whether the seat is kept for its occupant, whose presence stream has broken a short time ago. No other member
    /// can take it.
    #[serde(default, skip_serializing_if = "is_false")]
    pub kept: bool,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_false(value: &bool) -> bool {
    !value
}

/// The person on a seat.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Taken {
    /// What they announced.
    pub announcement: Announcement,
    /// What they are called.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub person: Option<PersonName>,
    /// Which key they have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proof: Option<MemberProof>,
}

/// The body of the request by which an occupant leaves its seat on purpose.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaveSeat {
    /// As in [`EnterRoom`].
    pub occupant: Name,
}

/// The body of the request that enters a room as its sender.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EnterRoom {
    /// What the sender announces.
    #[serde(flatten)]
    pub announcement: Announcement,
    /// What the sender is called; others in a call read it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub person: Option<PersonName>,
    /// Made up by the program that takes a seat, and told to the server alone. A seat is taken again only by the program that says the same; others are refused while it is taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occupant: Option<Name>,
    /// Of a member: which key it has, for the other members.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proof: Option<MemberProof>,
    /// Viewers' tokens that hold no longer, by their names ([`ViewerToken`](crate::rooms::ViewerToken)): the newest [`MAX_REVOKED`](crate::limits::MAX_REVOKED).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub revoked: Vec<Name>,
}

impl From<Announcement> for EnterRoom {
    fn from(announcement: Announcement) -> Self {
        Self {
            announcement,
            person: None,
            occupant: None,
            proof: None,
            revoked: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AVATAR: &str = r#""avatar":{"sha256":"ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad","bytes":3},"channel":"unreliable","codec":"compact","rate_hz":30.0"#;

    #[test]
    fn a_sender_without_a_name_enters_as_before() {
        let old = format!("{{{AVATAR}}}");
        let enter: EnterRoom = serde_json::from_str(&old).expect("an older sender's");
        assert_eq!(enter, EnterRoom::from(enter.announcement));
        assert_eq!(serde_json::to_string(&enter).expect("written"), old);
        let named = format!(r#"{{{AVATAR},"person":"Ada","occupant":"o1"}}"#);
        let enter: EnterRoom = serde_json::from_str(&named).expect("a member's");
        assert_eq!(enter.person.as_ref().map(PersonName::as_str), Some("Ada"));
        let proved = format!(r#"{{{AVATAR},"proof":"a=x:y\r\n"}}"#);
        let enter: EnterRoom = serde_json::from_str(&proved).expect("a proof of two lines");
        assert_eq!(serde_json::to_string(&enter).expect("written"), proved);
        for wrong in ["\\u001b[2J".to_owned(), "a".repeat(513)] {
            let wrong = format!(r#"{{{AVATAR},"proof":"{wrong}"}}"#);
            assert!(serde_json::from_str::<EnterRoom>(&wrong).is_err());
        }
        let steering = format!(r#"{{{AVATAR},"person":"\u001b[2J"}}"#);
        assert!(serde_json::from_str::<EnterRoom>(&steering).is_err());
        let slow = named.replace("30.0", "0.5");
        assert!(
            serde_json::from_str::<EnterRoom>(&slow).is_err(),
            "bounds hold"
        );
    }

    #[test]
    fn seats_are_read_as_written_and_a_token_is_not_shown() {
        let text = format!(
            r#"{{"seats":[{{"room":"r1","taken":{{"announcement":{{{AVATAR}}},"person":"Ada"}}}},{{"room":"r2"}},{{"room":"r3","kept":true}}]}}"#
        );
        let status: CallStatus = serde_json::from_str(&text).expect("a status");
        assert!(status.seats[1].taken.is_none(), "the second one is free");
        assert!(!status.seats[1].kept && status.seats[2].kept);
        assert_eq!(serde_json::to_string(&status).expect("written"), text);
        let opened: OpenedCall =
            serde_json::from_str(r#"{"call":"c1","member_token":"secret","expires":9}"#)
                .expect("a call");
        assert!(!format!("{opened:?}").contains("secret"));
    }
}
