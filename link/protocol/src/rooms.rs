//! The JSON bodies about rooms, and of every refusal.

use crate::Name;
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

/// The body of an answer that is no success.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErrorBody {
    /// What went wrong, one sentence.
    pub error: String,
}
