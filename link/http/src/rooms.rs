//! Rooms: opening one, reading the sender's announcement, and the offer and the answer that begin a call.

use std::{
    fmt,
    time::{Duration, SystemTime},
};

use reqwest::{
    Method, StatusCode,
    header::{ACCEPT, CONTENT_TYPE, LOCATION},
};

use crate::{
    Client, HttpError,
    client::{ADD_VIEWER, ANSWER, LEAVE, OFFER, OPEN_ROOM, ROOM, invalid_response},
};
use link_protocol::{
    Announcement, Name, RoomLink, Token,
    room_link::ServerUrl,
    rooms::{OpenRoom, OpenedRoom, RoomStatus, SDP_MEDIA_TYPE, ViewerToken},
};

/// A room that was opened.
#[derive(Debug, Clone)]
pub struct Room {
    /// The sender's link.
    pub sender: RoomLink,
    /// The viewers' link.
    pub viewer: RoomLink,
    /// When both end, by the server's clock.
    pub expires: SystemTime,
}

/// A sender's answer to an offer.
#[derive(Clone, PartialEq, Eq)]
pub struct Answer {
    /// The SDP, with all its candidates.
    pub sdp: String,
    /// The session's name on the server, for [`Client::leave`].
    pub session: Name,
}

// An SDP holds addresses and a password.
impl fmt::Debug for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Answer")
            .field("session", &self.session)
            .finish_non_exhaustive()
    }
}

impl Client {
    /// Opens a room. Without a `lifetime` the server chooses one.
    ///
    /// # Errors
    /// [`HttpError::Unauthorized`] if this is no owner's token of that server, and those of any request.
    pub async fn open_room(
        &self,
        server: &ServerUrl,
        owner_token: &str,
        lifetime: Option<Duration>,
    ) -> Result<Room, HttpError> {
        let token = Token::new(owner_token)?;
        let order = OpenRoom {
            lifetime_s: lifetime.map(|lifetime| lifetime.as_secs()),
        };
        let request = self
            .request(Method::POST, server, &token, &["rooms"])?
            .json(&order);
        let reply = self.exchange(server, OPEN_ROOM, request).await?;
        if reply.status != StatusCode::CREATED {
            return Err(reply.refusal(server, &token, OPEN_ROOM));
        }
        let opened: OpenedRoom = reply.json(server, &token, OPEN_ROOM)?;
        let link = |token: &str| RoomLink::of(server.clone(), opened.room.as_str(), token);
        let expires = SystemTime::UNIX_EPOCH
            .checked_add(Duration::from_secs(opened.expires))
            .ok_or_else(|| invalid_response(server, OPEN_ROOM, "a time that is out of range"))?;
        Ok(Room {
            sender: link(&opened.sender_token)?,
            viewer: link(&opened.viewer_token)?,
            expires,
        })
    }

    /// One more viewer's token of the sender's room, which the sender can revoke by its name. Without a `lifetime` it holds as long as the room's.
    ///
    /// # Errors
    /// [`HttpError::NotFound`] if the link is a viewer's, and those of any request.
    pub async fn add_viewer(
        &self,
        sender: &RoomLink,
        lifetime: Option<Duration>,
    ) -> Result<ViewerToken, HttpError> {
        let server = sender.server();
        let order = OpenRoom {
            lifetime_s: lifetime.map(|lifetime| lifetime.as_secs()),
        };
        let segments = ["rooms", sender.room().as_str(), "viewers"];
        let request = (self.request(Method::POST, server, sender.token(), &segments)?).json(&order);
        let reply = self.exchange(server, ADD_VIEWER, request).await?;
        if reply.status != StatusCode::CREATED {
            return Err(reply.refusal(server, sender.token(), ADD_VIEWER));
        }
        reply.json(server, sender.token(), ADD_VIEWER)
    }

    /// What the room's sender announces; nothing while it is absent.
    ///
    /// # Errors
    /// [`HttpError::Unauthorized`] or [`HttpError::NotFound`] if the link is wrong or has expired, and those of any request.
    pub async fn announcement(&self, viewer: &RoomLink) -> Result<Option<Announcement>, HttpError> {
        let status = self.room_status(viewer).await?;
        Ok(status.map(|status| status.announcement))
    }

    /// What there is to know of a room before joining it; nothing while its sender is absent.
    ///
    /// # Errors
    /// As [`Client::announcement`].
    pub async fn room_status(&self, viewer: &RoomLink) -> Result<Option<RoomStatus>, HttpError> {
        let server = viewer.server();
        let request = self.request(
            Method::GET,
            server,
            viewer.token(),
            &["rooms", viewer.room().as_str()],
        )?;
        let reply = self.exchange(server, ROOM, request).await?;
        match reply.status {
            StatusCode::OK => reply.json(server, viewer.token(), ROOM).map(Some),
            StatusCode::SERVICE_UNAVAILABLE => Ok(None),
            _ => Err(reply.refusal(server, viewer.token(), ROOM)),
        }
    }

    /// Offers a connection to the sender: an SDP with all its candidates.
    ///
    /// # Errors
    /// [`HttpError::SenderAbsent`], [`HttpError::SenderTimedOut`], and as [`Client::announcement`].
    pub async fn offer(&self, viewer: &RoomLink, sdp: &str) -> Result<Answer, HttpError> {
        let server = viewer.server();
        let request = self
            .request(
                Method::POST,
                server,
                viewer.token(),
                &["rooms", viewer.room().as_str(), "whep"],
            )?
            .header(CONTENT_TYPE, SDP_MEDIA_TYPE)
            .header(ACCEPT, SDP_MEDIA_TYPE)
            .body(sdp.to_owned());
        let reply = self.exchange(server, OFFER, request).await?;
        match reply.status {
            StatusCode::CREATED => {}
            StatusCode::SERVICE_UNAVAILABLE => {
                return Err(HttpError::SenderAbsent {
                    retry_after: reply.retry_after(),
                });
            }
            StatusCode::GATEWAY_TIMEOUT => return Err(HttpError::SenderTimedOut),
            _ => return Err(reply.refusal(server, viewer.token(), OFFER)),
        }
        let session = reply
            .headers
            .get(LOCATION)
            .and_then(|location| location.to_str().ok())
            .and_then(|location| location.rsplit_once("/sessions/"))
            .and_then(|(_, session)| session.parse().ok())
            .ok_or_else(|| invalid_response(server, OFFER, "no session in its Location header"))?;
        let sdp = String::from_utf8(reply.body)
            .map_err(|_| invalid_response(server, OFFER, "an answer that is no text"))?;
        Ok(Answer { sdp, session })
    }

    /// Ends a session: the server tells the sender. One that has ended already is no error.
    ///
    /// # Errors
    /// As [`Client::announcement`], without [`HttpError::NotFound`].
    pub async fn leave(&self, viewer: &RoomLink, session: &Name) -> Result<(), HttpError> {
        let server = viewer.server();
        let segments = [
            "rooms",
            viewer.room().as_str(),
            "sessions",
            session.as_str(),
        ];
        let request = self.request(Method::DELETE, server, viewer.token(), &segments)?;
        let reply = self.exchange(server, LEAVE, request).await?;
        match reply.status {
            StatusCode::NO_CONTENT | StatusCode::OK | StatusCode::NOT_FOUND => Ok(()),
            _ => Err(reply.refusal(server, viewer.token(), LEAVE)),
        }
    }

    /// Answers a viewer's offer: an SDP with all its candidates.
    ///
    /// # Errors
    /// [`HttpError::NotFound`] if that viewer does not wait any more, and those of any request.
    pub async fn answer(
        &self,
        sender: &RoomLink,
        session: &Name,
        sdp: &str,
    ) -> Result<(), HttpError> {
        let server = sender.server();
        let segments = [
            "rooms",
            sender.room().as_str(),
            "sessions",
            session.as_str(),
            "answer",
        ];
        let request = self
            .request(Method::PUT, server, sender.token(), &segments)?
            .header(CONTENT_TYPE, SDP_MEDIA_TYPE)
            .body(sdp.to_owned());
        let reply = self.exchange(server, ANSWER, request).await?;
        match reply.status {
            StatusCode::NO_CONTENT | StatusCode::OK => Ok(()),
            _ => Err(reply.refusal(server, sender.token(), ANSWER)),
        }
    }
}
