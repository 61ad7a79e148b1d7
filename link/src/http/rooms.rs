//! Rooms: opening one, asking about one, and the one offer and answer by which a viewer joins.

use std::time::Duration;

use reqwest::header::{CONTENT_TYPE, LOCATION};
use reqwest::{Method, StatusCode};
use serde::Deserialize;

use super::client::{ANSWERING, Request};
use super::room_link::{Token, is_name};
use super::{Announcement, Client, HttpError, RoomLink, ServerUrl};

const SDP: &str = "application/sdp";
const LINK_ADVICE: &str = "ask whoever gave you the link for a new one";

/// A room that was opened.
#[derive(Debug, Clone)]
pub struct Room {
    /// The sender's link.
    pub sender: RoomLink,
    /// The viewers' link.
    pub viewer: RoomLink,
    /// When both end, Unix seconds.
    pub expires: u64,
}

/// The sender's answer to an offer.
#[derive(Debug, Clone)]
pub struct Answer {
    /// What the sender says.
    pub sdp: String,
    /// The server's name for this viewer's session.
    pub session: String,
}

impl Client {
    /// Opens a room for `lifetime`, or as long as the server likes.
    ///
    /// # Errors
    /// If the server cannot be reached or the token opens no rooms there.
    pub async fn open_room(
        &self,
        server: &ServerUrl,
        owner_token: &str,
        lifetime: Option<Duration>,
    ) -> Result<Room, HttpError> {
        #[derive(Deserialize)]
        struct Opened {
            room: String,
            sender_token: String,
            viewer_token: String,
            expires: u64,
        }
        let token = Token::new(owner_token)?;
        let about = Request {
            server,
            token: &token,
            what: "opening a room",
            advice: "only an owner's token opens rooms",
        };
        let mut request = self.request(&about, Method::POST, &["rooms"])?;
        if let Some(lifetime) = lifetime {
            request = request.json(&serde_json::json!({ "lifetime_s": lifetime.as_secs() }));
        }
        let response = about.send(request, ANSWERING).await?;
        let opened: Opened = about.read_json(response, ANSWERING).await?;
        if !is_name(&opened.room) {
            return Err(about.unintelligible("its room has no possible name"));
        }
        let link = |token: &str| {
            Ok::<_, HttpError>(RoomLink::new(
                server.clone(),
                opened.room.clone(),
                Token::new(token)?,
            ))
        };
        Ok(Room {
            sender: link(&opened.sender_token)?,
            viewer: link(&opened.viewer_token)?,
            expires: opened.expires,
        })
    }

    /// What the sender announces; `None` while it is not there.
    ///
    /// # Errors
    /// If the server cannot be reached or the link is not (any more) good there.
    pub async fn ask(&self, room: &RoomLink) -> Result<Option<Announcement>, HttpError> {
        let about = about(room, "the room");
        let request = self.request(&about, Method::GET, &["rooms", room.room()])?;
        match about.send(request, ANSWERING).await {
            Ok(response) => about.read_json(response, ANSWERING).await.map(Some),
            Err(HttpError::Unavailable { status: 503, .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Offers to join and waits for the sender's answer.
    ///
    /// # Errors
    /// [`HttpError::SenderAbsent`], [`HttpError::SenderSilent`], and as [`Self::ask`].
    pub async fn offer(&self, viewer: &RoomLink, sdp: &str) -> Result<Answer, HttpError> {
        let about = about(viewer, "joining");
        let request = self
            .request(&about, Method::POST, &["rooms", viewer.room(), "whep"])?
            .header(CONTENT_TYPE, SDP)
            .body(sdp.to_owned());
        let response = match about.send(request, ANSWERING).await {
            Err(HttpError::Unavailable {
                status: 503,
                retry_after,
                ..
            }) => return Err(HttpError::SenderAbsent { retry_after }),
            Err(HttpError::Unavailable { status: 504, .. }) => return Err(HttpError::SenderSilent),
            response => response?,
        };
        let location = response
            .headers()
            .get(LOCATION)
            .and_then(|location| location.to_str().ok());
        let session = location
            .and_then(|location| location.rsplit('/').next())
            .unwrap_or_default()
            .to_owned();
        if response.status() != StatusCode::CREATED || !is_name(&session) {
            return Err(about.unintelligible("it names no session"));
        }
        let sdp = about.read_text(response, ANSWERING).await?;
        Ok(Answer { sdp, session })
    }

    /// Tells the server that a viewer has left.
    ///
    /// # Errors
    /// As [`Self::ask`].
    pub async fn leave(&self, viewer: &RoomLink, session: &str) -> Result<(), HttpError> {
        let about = about(viewer, "the session");
        let request = self.request(
            &about,
            Method::DELETE,
            &["rooms", viewer.room(), "sessions", session],
        )?;
        about.send(request, ANSWERING).await.map(drop)
    }

    /// Answers a viewer's offer.
    ///
    /// # Errors
    /// As [`Self::ask`]; [`HttpError::NotFound`] if the viewer no longer waits.
    pub async fn answer(
        &self,
        sender: &RoomLink,
        session: &str,
        sdp: &str,
    ) -> Result<(), HttpError> {
        let about = about(sender, "the viewer's offer");
        if !is_name(session) {
            return Err(about.unintelligible("its session has no possible name"));
        }
        let request = self
            .request(
                &about,
                Method::PUT,
                &["rooms", sender.room(), "sessions", session, "answer"],
            )?
            .header(CONTENT_TYPE, SDP)
            .body(sdp.to_owned());
        about.send(request, ANSWERING).await.map(drop)
    }
}

pub(super) fn about<'a>(room: &'a RoomLink, what: &'static str) -> Request<'a> {
    Request {
        server: room.server(),
        token: room.token(),
        what,
        advice: LINK_ADVICE,
    }
}
