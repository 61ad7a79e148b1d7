//! A sender's presence in its room: a stream of events that lasts as long as the sender is there. It does not come back by itself;
//! whoever holds it decides when to be present again.

use std::{collections::VecDeque, fmt};

use reqwest::{
    Method, Response, StatusCode,
    header::{ACCEPT, CONTENT_TYPE},
};
use serde::{Deserialize, de::DeserializeOwned};
use tokio::time::Instant;

use crate::{
    Client, HttpError,
    client::{PRESENCE, Patience, next_piece, unintelligible},
    sse::{Event, Parser},
};
use link_protocol::{
    Announcement, RoomLink,
    room_link::{ServerUrl, is_name},
};

/// What a sender is told.
#[derive(Clone, PartialEq, Eq)]
pub enum PresenceEvent {
    /// A viewer wants to be called: answer with [`Client::answer`] within 5 s.
    Offer {
        /// The session's name on the server.
        session: String,
        /// The viewer's SDP, with all its candidates.
        sdp: String,
    },
    /// A viewer has left.
    Leave {
        /// The session's name on the server.
        session: String,
    },
    /// Another sender has come with this link: nothing follows.
    Replaced,
}

// An SDP holds addresses and a password.
impl fmt::Debug for PresenceEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Offer { session, .. } => f
                .debug_struct("Offer")
                .field("session", session)
                .finish_non_exhaustive(),
            Self::Leave { session } => f.debug_struct("Leave").field("session", session).finish(),
            Self::Replaced => f.write_str("Replaced"),
        }
    }
}

/// An open presence. Dropping it ends it.
#[derive(Debug)]
pub struct Presence {
    server: ServerUrl,
    stream: Response,
    parser: Parser,
    ready: VecDeque<Event>,
    /// When bytes last came.
    heard: Instant,
    patience: Patience,
    ended: bool,
}

impl Client {
    /// Takes the sender's place in its room. Another sender that holds it is told that it was replaced.
    ///
    /// # Errors
    /// [`ProtocolError::Announcement`](link_protocol::ProtocolError::Announcement) if it is out of bounds, [`HttpError::NotFound`] if the room is gone or its owner has no such
    /// package (upload it first), and those of any request.
    pub async fn present(
        &self,
        sender: &RoomLink,
        announcement: &Announcement,
    ) -> Result<Presence, HttpError> {
        let announcement = announcement.checked()?;
        let server = sender.server();
        let request = self
            .request(
                Method::POST,
                server,
                sender.token(),
                &["rooms", sender.room(), "presence"],
            )?
            .header(ACCEPT, "text/event-stream")
            .json(&announcement);
        let stream = self.open(server, PRESENCE, request).await?;
        if stream.status() != StatusCode::OK {
            return Err(self.refusal(server, sender.token(), PRESENCE, stream).await);
        }
        let kind = stream
            .headers()
            .get(CONTENT_TYPE)
            .map(|kind| kind.as_bytes())
            .unwrap_or_default();
        if !kind.starts_with(b"text/event-stream") {
            return Err(unintelligible(server, PRESENCE, "no text/event-stream"));
        }
        Ok(Presence {
            server: server.clone(),
            stream,
            parser: Parser::default(),
            ready: VecDeque::new(),
            heard: Instant::now(),
            patience: *self.patience(),
            ended: false,
        })
    }
}

impl Presence {
    /// Waits for the next event. May be cancelled, in `select!`, without losing one.
    ///
    /// # Errors
    /// [`HttpError::PresenceSilent`] if nothing, not even a comment, has come for 15 s, [`HttpError::PresenceEnded`] once the
    /// stream is over, [`HttpError::Broken`] if it was cut, [`HttpError::Unintelligible`] for an event that cannot be.
    pub async fn next(&mut self) -> Result<PresenceEvent, HttpError> {
        loop {
            while let Some(event) = self.ready.pop_front() {
                // What a later version may send is not for us.
                if let Some(event) = self.read(&event)? {
                    self.ended = event == PresenceEvent::Replaced;
                    return Ok(event);
                }
            }
            if self.ended {
                return Err(HttpError::PresenceEnded {
                    server: self.server.clone(),
                });
            }
            let limit = self.patience.silence;
            let piece = tokio::time::timeout_at(
                self.heard + limit,
                next_piece(&self.server, &mut self.stream),
            )
            .await
            .map_err(|_| HttpError::PresenceSilent {
                server: self.server.clone(),
                limit,
            })??;
            self.heard = Instant::now();
            match piece {
                Some(piece) => self
                    .parser
                    .push(&piece, &mut self.ready)
                    .map_err(|_| unintelligible(&self.server, PRESENCE, "an event without end"))?,
                None => self.ended = true,
            }
        }
    }

    fn read(&self, event: &Event) -> Result<Option<PresenceEvent>, HttpError> {
        #[derive(Deserialize)]
        struct Offer {
            session: String,
            sdp: String,
        }
        #[derive(Deserialize)]
        struct Leave {
            session: String,
        }
        match event.kind.as_str() {
            "offer" => {
                let Offer { session, sdp } = self.data(event)?;
                Ok(Some(PresenceEvent::Offer {
                    session: self.named(session)?,
                    sdp,
                }))
            }
            "leave" => {
                let Leave { session } = self.data(event)?;
                Ok(Some(PresenceEvent::Leave {
                    session: self.named(session)?,
                }))
            }
            "replaced" => Ok(Some(PresenceEvent::Replaced)),
            _ => Ok(None),
        }
    }

    fn data<T: DeserializeOwned>(&self, event: &Event) -> Result<T, HttpError> {
        serde_json::from_str(&event.data).map_err(|error| {
            unintelligible(
                &self.server,
                PRESENCE,
                format!("in `{}`: {error}", event.kind),
            )
        })
    }

    fn named(&self, session: String) -> Result<String, HttpError> {
        if is_name(&session) {
            Ok(session)
        } else {
            Err(unintelligible(
                &self.server,
                PRESENCE,
                "a session's name that cannot be",
            ))
        }
    }
}
