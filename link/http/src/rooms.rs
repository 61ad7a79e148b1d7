//! Rooms: opening one, asking about it, and the one offer and one answer that begin a call.

use std::{
    fmt,
    time::{Duration, SystemTime},
};

use reqwest::{
    Method, StatusCode,
    header::{ACCEPT, CONTENT_TYPE, LOCATION},
};
use serde::{Deserialize, Serialize};

use crate::{
    Client, HttpError,
    client::{ANSWER, LEAVE, OFFER, OPEN_ROOM, ROOM, unintelligible},
};
use link_protocol::{
    Announcement, RoomLink,
    room_link::{ServerUrl, Token, is_name},
};

const SDP: &str = "application/sdp";

/// A room that was opened.
#[derive(Debug, Clone)]
pub struct Room {
    /// The link of the one who sends.
    pub sender: RoomLink,
    /// The link of those who watch.
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
    pub session: String,
}

// An SDP holds addresses and a password.
impl fmt::Debug for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Answer")
            .field("session", &self.session)
            .finish_non_exhaustive()
    }
}

#[derive(Serialize)]
struct Wish {
    #[serde(skip_serializing_if = "Option::is_none")]
    lifetime_s: Option<u64>,
}

#[derive(Deserialize)]
struct Opened {
    room: String,
    sender_token: String,
    viewer_token: String,
    expires: u64,
}

impl Client {
    /// Opens a room; the server chooses how long it lasts where nothing is said.
    ///
    /// # Errors
    /// [`HttpError::NotAccepted`] if this is no owner's token of that server, and those of any request.
    pub async fn open_room(
        &self,
        server: &ServerUrl,
        owner_token: &str,
        lifetime: Option<Duration>,
    ) -> Result<Room, HttpError> {
        let token = Token::new(owner_token)?;
        let wish = Wish {
            lifetime_s: lifetime.map(|lifetime| lifetime.as_secs()),
        };
        let request = self
            .request(Method::POST, server, &token, &["rooms"])?
            .json(&wish);
        let reply = self.exchange(server, OPEN_ROOM, request).await?;
        if reply.status != StatusCode::CREATED {
            return Err(reply.refusal(server, &token, OPEN_ROOM));
        }
        let opened: Opened = reply.json(server, &token, OPEN_ROOM)?;
        if !is_name(&opened.room) {
            return Err(unintelligible(
                server,
                OPEN_ROOM,
                "a room's name that cannot be",
            ));
        }
        let link = |token: &str| RoomLink::of(server.clone(), &opened.room, token);
        let expires = SystemTime::UNIX_EPOCH
            .checked_add(Duration::from_secs(opened.expires))
            .ok_or_else(|| unintelligible(server, OPEN_ROOM, "a time that cannot be"))?;
        Ok(Room {
            sender: link(&opened.sender_token)?,
            viewer: link(&opened.viewer_token)?,
            expires,
        })
    }

    /// What the sender announces; nothing while it is not there.
    ///
    /// # Errors
    /// [`HttpError::NotAccepted`] or [`HttpError::NotFound`] if the link is not, or no longer, good, and those of any request.
    pub async fn ask(&self, viewer: &RoomLink) -> Result<Option<Announcement>, HttpError> {
        let server = viewer.server();
        let request = self.request(
            Method::GET,
            server,
            viewer.token(),
            &["rooms", viewer.room()],
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
    /// [`HttpError::SenderAbsent`], [`HttpError::SenderSilent`], and as [`Client::ask`].
    pub async fn offer(&self, viewer: &RoomLink, sdp: &str) -> Result<Answer, HttpError> {
        let server = viewer.server();
        let request = self
            .request(
                Method::POST,
                server,
                viewer.token(),
                &["rooms", viewer.room(), "whep"],
            )?
            .header(CONTENT_TYPE, SDP)
            .header(ACCEPT, SDP)
            .body(sdp.to_owned());
        let reply = self.exchange(server, OFFER, request).await?;
        match reply.status {
            StatusCode::CREATED => {}
            StatusCode::SERVICE_UNAVAILABLE => {
                return Err(HttpError::SenderAbsent {
                    retry_after: reply.retry_after(),
                });
            }
            StatusCode::GATEWAY_TIMEOUT => return Err(HttpError::SenderSilent),
            _ => return Err(reply.refusal(server, viewer.token(), OFFER)),
        }
        let session = reply
            .headers
            .get(LOCATION)
            .and_then(|location| location.to_str().ok())
            .and_then(|location| location.rsplit_once("/sessions/"))
            .map(|(_, session)| session)
            .filter(|session| is_name(session))
            .ok_or_else(|| unintelligible(server, OFFER, "no session in its Location header"))?
            .to_owned();
        let sdp = String::from_utf8(reply.body)
            .map_err(|_| unintelligible(server, OFFER, "an answer that is no text"))?;
        Ok(Answer { sdp, session })
    }

    /// Ends a session, so that the sender need not find out by itself. One that is gone already is no error.
    ///
    /// # Errors
    /// As [`Client::ask`], without [`HttpError::NotFound`].
    pub async fn leave(&self, viewer: &RoomLink, session: &str) -> Result<(), HttpError> {
        let server = viewer.server();
        let session = checked_session(server, LEAVE, session)?;
        let segments = ["rooms", viewer.room(), "sessions", session];
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
    /// [`HttpError::NotFound`] if that viewer no longer waits, and those of any request.
    pub async fn answer(
        &self,
        sender: &RoomLink,
        session: &str,
        sdp: &str,
    ) -> Result<(), HttpError> {
        let server = sender.server();
        let session = checked_session(server, ANSWER, session)?;
        let segments = ["rooms", sender.room(), "sessions", session, "answer"];
        let request = self
            .request(Method::PUT, server, sender.token(), &segments)?
            .header(CONTENT_TYPE, SDP)
            .body(sdp.to_owned());
        let reply = self.exchange(server, ANSWER, request).await?;
        match reply.status {
            StatusCode::NO_CONTENT | StatusCode::OK => Ok(()),
            _ => Err(reply.refusal(server, sender.token(), ANSWER)),
        }
    }
}

/// A session's name stands in a path.
fn checked_session<'a>(
    server: &ServerUrl,
    what: &'static str,
    session: &'a str,
) -> Result<&'a str, HttpError> {
    if is_name(session) {
        Ok(session)
    } else {
        Err(unintelligible(
            server,
            what,
            "a session's name that cannot be",
        ))
    }
}
