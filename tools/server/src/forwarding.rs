//! What the server asks of the program's part that forwards, which it has none of itself: motion and voice are a call's. A sender that serves as many viewers as
//! it will refuses the next one's offer; where the server forwards, the offer goes there.

use crate::Id;
use crate::http::App;
use crate::rooms::{RoomReply, RoomRequest};
use link_protocol::{Announcement, IceServers, Name};
use std::fmt;
use std::sync::{Arc, Weak};

/// Takes viewers whom their sender hands over.
#[async_trait::async_trait]
pub trait Forwarding: fmt::Debug + Send + Sync {
    /// The answer to a viewer's offer; nothing where this one is not taken.
    async fn take(&self, viewer: HandedOver) -> Option<String>;

    /// A viewer says that it has left, if it is one that was taken here.
    fn leave(&self, session: &Name);
}

/// A viewer whom a sender hands over.
#[derive(Debug)]
pub struct HandedOver {
    /// Where its sender is.
    pub room: SendersRoom,
    /// Its session's name.
    pub session: Name,
    /// Its SDP.
    pub offer: String,
    /// The STUN and TURN servers that it was told.
    pub ice_servers: IceServers,
}

/// The room of a sender on this instance or another one, as the server's own forwarder sees it.
#[derive(Clone)]
pub struct SendersRoom {
    app: Weak<App>,
    room: Id,
}

impl fmt::Debug for SendersRoom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("SendersRoom").field(&self.name()).finish()
    }
}

impl SendersRoom {
    pub(crate) fn new(app: &Arc<App>, room: Id) -> Self {
        Self {
            app: Arc::downgrade(app),
            room,
        }
    }

    /// The room's name.
    #[must_use]
    pub fn name(&self) -> Name {
        self.room.into()
    }

    /// What its sender announces; nothing while it is absent, or the server ends.
    pub async fn announcement(&self) -> Option<Announcement> {
        let app = self.app.upgrade()?;
        match app.ask(self.room, RoomRequest::Announcement).await {
            RoomReply::Announcement { announcement, .. } => Some(announcement),
            _ => None,
        }
    }

    /// Offers the sender a connection; its session's name and the answer.
    pub async fn offer(&self, sdp: &str) -> Option<(Name, String)> {
        let app = self.app.upgrade()?;
        let session = Id::random()
            .inspect_err(|error| log::error!("{error}"))
            .ok()?;
        let request = RoomRequest::Offer {
            session,
            sdp: sdp.to_owned(),
            forwards: true,
        };
        match app.ask(self.room, request).await {
            RoomReply::Answer { sdp } => Some((session.into(), sdp)),
            other => {
                log::debug!(
                    "the sender of room {} is not forwarded: {other:?}",
                    self.room
                );
                None
            }
        }
    }
}
