//! The server's forwarder: halls of the call's library for the rooms of the server's.

use link_call::forward::Halls;
use link_call::{CallError, Signaling};
use link_http::rooms::Answer;
use link_protocol::room_link::ServerUrl;
use link_protocol::rooms::RoomStatus;
use link_protocol::{Name, RoomLink};
use server::{Forwarding, HandedOver, SendersRoom};
use std::sync::Arc;

/// What takes viewers whom their senders hand over to this server.
#[derive(Debug)]
pub(super) struct Forwarder {
    halls: Halls,
    /// By which this side is found: it binds the addresses that lead there.
    address: ServerUrl,
}

impl Forwarder {
    /// For a server at `address`, with `most` viewers at once.
    pub(super) fn new(address: ServerUrl, most: usize) -> Self {
        Self {
            halls: Halls::new(most),
            address,
        }
    }
}

#[async_trait::async_trait]
impl Forwarding for Forwarder {
    async fn take(&self, viewer: HandedOver) -> Option<String> {
        let HandedOver {
            room,
            session,
            offer,
            network,
        } = viewer;
        // There is no token: nothing is asked over HTTP.
        let link = RoomLink::of(self.address.clone(), room.name().as_str(), "none");
        let link = link.inspect_err(|error| log::error!("{error}")).ok()?;
        let room = OwnRoom { link, room };
        let taken = self.halls.take(Arc::new(room), session, offer, network);
        taken
            .await
            .inspect_err(|error| log::warn!("a viewer is not forwarded to: {error}"))
            .ok()
    }

    fn leave(&self, session: &Name) {
        self.halls.leave(session);
    }

    fn viewers(&self) -> usize {
        self.halls.viewers()
    }
}

/// A room of this server's, without going through HTTP.
#[derive(Debug)]
struct OwnRoom {
    link: RoomLink,
    room: Box<dyn SendersRoom>,
}

#[async_trait::async_trait]
impl Signaling for OwnRoom {
    fn room(&self) -> &RoomLink {
        &self.link
    }

    async fn status(&self) -> Result<RoomStatus, CallError> {
        let announcement = self.room.announcement().await;
        Ok(RoomStatus {
            announcement: announcement.ok_or(CallError::SenderAbsent)?,
            ice_servers: self.room.ice_servers(),
        })
    }

    async fn offer(&self, sdp: &str) -> Result<Answer, CallError> {
        let answer = self.room.offer(sdp).await;
        let (session, sdp) = answer.ok_or(CallError::SenderAbsent)?;
        Ok(Answer { sdp, session })
    }

    async fn left(&self, session: &Name) {
        self.room.left(session).await;
    }
}
