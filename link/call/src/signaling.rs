//! How a viewer's offer gets to the sender of its room.

use crate::CallError;
use link_http::Client;
use link_http::rooms::Answer;
use link_protocol::rooms::RoomStatus;
use link_protocol::{Name, RoomLink};

/// A room, as one who joins it sees it. A server that forwards is a viewer of the rooms it has, without going through itself.
#[async_trait::async_trait]
pub trait Signaling: Send + Sync + std::fmt::Debug {
    /// The room; of its token, secret and key those are used that are there.
    fn room(&self) -> &RoomLink;

    /// What there is to know before joining.
    ///
    /// # Errors
    /// [`CallError::SenderAbsent`], and those of a request.
    async fn status(&self) -> Result<RoomStatus, CallError>;

    /// Offers a connection; the sender's answer.
    ///
    /// # Errors
    /// [`CallError::SenderAbsent`], and those of a request.
    async fn offer(&self, sdp: &str) -> Result<Answer, CallError>;

    /// Tells the sender that a viewer whom it handed over is served no longer, or could not be.
    async fn left(&self, session: &Name);
}

/// A room on a server that is reached over HTTP.
#[derive(Debug, Clone)]
pub(crate) struct HttpRoom {
    pub(crate) client: Client,
    pub(crate) room: RoomLink,
}

#[async_trait::async_trait]
impl Signaling for HttpRoom {
    fn room(&self) -> &RoomLink {
        &self.room
    }

    async fn status(&self) -> Result<RoomStatus, CallError> {
        let status = self.client.room_status(&self.room).await?;
        status.ok_or(CallError::SenderAbsent)
    }

    async fn offer(&self, sdp: &str) -> Result<Answer, CallError> {
        Ok(self.client.offer(&self.room, sdp).await?)
    }

    /// Nobody hands viewers over but to their room's own server.
    async fn left(&self, _: &Name) {}
}
