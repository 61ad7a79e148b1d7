//! The JSON bodies about rooms, and of every refusal.

use crate::{Announcement, IceServers, Name};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The media type of offers and answers.
pub const SDP_MEDIA_TYPE: &str = "application/sdp";

/// The body of the request that opens a room.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct OpenRoom {
    /// How long the room's tokens are valid, seconds; the server's choice where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lifetime_s: Option<u64>,
}

/// The answer to [`OpenRoom`]. Its [`Debug`] hides the tokens.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct OpenedRoom {
    /// The room's name.
    pub room: Name,
    /// The token of the sender.
    pub sender_token: String,
    /// The token of viewers.
    pub viewer_token: String,
    /// When both expire, Unix seconds.
    pub expires: u64,
}

impl fmt::Debug for OpenedRoom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OpenedRoom")
            .field("room", &self.room)
            .field("expires", &self.expires)
            .finish_non_exhaustive()
    }
}

/// The answer to the request for one more viewer's token, whose body is that of a room's ([`OpenRoom`]). Its [`Debug`] hides the token.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ViewerToken {
    /// What the token is called, to revoke it by.
    pub name: Name,
    /// The token.
    pub viewer_token: String,
    /// When it expires, Unix seconds; not after the room's own.
    pub expires: u64,
}

impl fmt::Debug for ViewerToken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ViewerToken")
            .field("name", &self.name)
            .field("expires", &self.expires)
            .finish_non_exhaustive()
    }
}

/// What a room's bearers are told of it: the sender's announcement, and the STUN and TURN servers to use now.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RoomStatus {
    /// The sender's announcement.
    #[serde(flatten)]
    pub announcement: Announcement,
    /// The servers, none of an older server.
    #[serde(default, skip_serializing_if = "IceServers::is_empty")]
    pub ice_servers: IceServers,
}

/// The body of an answer that is no success.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorBody {
    /// What went wrong, one sentence.
    pub error: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    const AVATAR: &str = r#""avatar":{"sha256":"ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad","bytes":3},"channel":"unreliable","codec":"compact","rate_hz":29.97"#;

    #[test]
    fn a_rooms_status_is_read_by_older_programs_and_theirs_by_this_one() {
        let old = format!("{{{AVATAR}}}");
        let status: RoomStatus = serde_json::from_str(&old).expect("an older server's");
        assert!(status.ice_servers.is_empty(), "no servers");
        let written = serde_json::to_string(&status).expect("written");
        assert_eq!(written, old, "without servers nothing is new");
        let new = format!(r#"{{{AVATAR},"ice_servers":[{{"urls":["stun:a"]}}]}}"#);
        let status: RoomStatus = serde_json::from_str(&new).expect("a status");
        assert_eq!(status.ice_servers.as_slice().len(), 1, "one server");
        assert_eq!(
            serde_json::to_string(&status).expect("written"),
            new,
            "written"
        );
        let announcement: Announcement = serde_json::from_str(&new).expect("by an older program");
        assert_eq!(announcement, status.announcement, "the announcement in it");
        let slow = new.replace("29.97", "0.5");
        assert!(
            serde_json::from_str::<RoomStatus>(&slow).is_err(),
            "bounds hold"
        );
    }
}
