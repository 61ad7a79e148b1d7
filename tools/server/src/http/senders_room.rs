//! A sender's room, for the server's own forwarder.

use super::App;
use crate::Id;
use crate::forwarding::SendersRoom;
use crate::rooms::{RoomReply, RoomRequest};
use link_protocol::{Announcement, IceServers, Name};
use std::sync::{Arc, Weak};
use std::time::Duration;

/// How often a sender is told at most that someone has left, while it or its instance is busy, and how far apart.
const LEFT_TRIES: usize = 20;
const LEFT_AGAIN: Duration = Duration::from_millis(500);

/// One that its sender may leave, and a server that may end.
#[derive(Debug)]
pub(super) struct RoomHere {
    app: Weak<App>,
    room: Id,
}

impl RoomHere {
    pub(super) fn new(app: &Arc<App>, room: Id) -> Self {
        Self {
            app: Arc::downgrade(app),
            room,
        }
    }
}

#[async_trait::async_trait]
impl SendersRoom for RoomHere {
    fn name(&self) -> Name {
        self.room.into()
    }

    async fn announcement(&self) -> Option<Announcement> {
        let app = self.app.upgrade()?;
        match app
            .ask(self.room, RoomRequest::Announcement { viewer: None })
            .await
        {
            RoomReply::Announcement { announcement, .. } => Some(announcement),
            _ => None,
        }
    }

    fn ice_servers(&self) -> IceServers {
        let app = self.app.upgrade();
        app.map_or_else(IceServers::default, |app| app.ice.own_servers(self.room))
    }

    async fn offer(&self, sdp: &str) -> Option<(Name, String)> {
        let app = self.app.upgrade()?;
        let session = Id::random().inspect_err(|error| log::error!("{error}"));
        let session = session.ok()?;
        let request = RoomRequest::Offer {
            session,
            sdp: sdp.to_owned(),
            forwards: true,
            viewer: None,
            network: None,
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

    async fn left(&self, session: &Name) {
        let Some(session) = Id::parse(session.as_str()) else {
            return;
        };
        // A sender has a moment's events before it at most.
        for _ in 0..LEFT_TRIES {
            let Some(app) = self.app.upgrade() else {
                return;
            };
            let request = RoomRequest::Leave { session };
            match app.ask(self.room, request).await {
                RoomReply::Busy | RoomReply::Unanswered | RoomReply::Unreachable => {
                    drop(app);
                    tokio::time::sleep(LEFT_AGAIN).await;
                }
                _ => return,
            }
        }
        log::debug!("the sender of room {} is not told who left", self.room);
    }
}
