//! The errors of a call.

use link_http::HttpError;
use link_protocol::ProtocolError;

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
    /// Offer and answer were exchanged, but no channel opened.
    #[error(
        "no connection could be made: sender and viewer must reach each other over UDP, with no NAT or firewall between them"
    )]
    NotConnected,
    /// The sender is not in its room.
    #[error("the sender is not in the room now")]
    SenderAbsent,
    /// The system gave no random number for a session.
    #[error("the system gives no random numbers")]
    Random(#[from] getrandom::Error),
    /// A task panicked.
    #[error("a task of the call failed")]
    Task(#[from] tokio::task::JoinError),
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
