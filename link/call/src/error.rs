//! The errors of a call.

use crate::plan::Relay;
use link_http::HttpError;
use link_protocol::ProtocolError;
use link_protocol::limits::MAX_PEOPLE;

/// An error of signaling, transport or transfer.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CallError {
    /// A request to the server failed.
    #[error(transparent)]
    Http(#[from] HttpError),
    /// The WebRTC connection could not be made or used.
    #[error("the WebRTC connection failed")]
    WebRtc(#[from] webrtc::error::Error),
    /// The WebRTC library made no description of a connection.
    #[error("WebRTC made no description of the connection")]
    NoDescription,
    /// The server or the sender did not answer in time, or the connection ended before it was open.
    #[error("no connection could be made in time")]
    NotConnected,
    /// Offer and answer were exchanged, but no packets pass between the two sides.
    #[error("no connection could be made: {}", no_way(relay.as_ref()))]
    NoWay {
        /// The relay that this side had.
        relay: Option<Relay>,
    },
    /// The sender is not in its room.
    #[error("the sender is not in the room now")]
    SenderAbsent,
    /// All seats of the call are taken.
    #[error("the call is full: it has {MAX_PEOPLE} seats, and all are taken")]
    Full,
    /// The system gave no random number for a session.
    #[error("the system gives no random numbers")]
    Random(#[from] getrandom::Error),
    /// A task panicked.
    #[error("a task of the call failed")]
    Task(#[from] tokio::task::JoinError),
}

/// What was tried, and what to do.
fn no_way(relay: Option<&Relay>) -> String {
    match relay {
        Some(relay) => format!(
            "neither directly nor relayed by {relay}; is the other side's network up, and does it let packets through to that server?"
        ),
        None => "a NAT or firewall lets nothing through between sender and viewer, and the server offers no relay that answers; \
                 its operator can start it with --turn"
            .to_owned(),
    }
}

impl CallError {
    /// Whether trying again later cannot help, because the link itself is wrong.
    #[must_use]
    pub fn is_final(&self) -> bool {
        matches!(self, Self::Http(error) if error.is_final())
    }

    /// Whether the room or package does not exist for this token.
    #[must_use]
    pub fn is_not_found(&self) -> bool {
        matches!(self, Self::Http(HttpError::NotFound { .. }))
    }
}

impl From<ProtocolError> for CallError {
    fn from(error: ProtocolError) -> Self {
        Self::Http(error.into())
    }
}
