//! The sender's presence in its room: an event stream that lasts as long as the sender is there.

use std::collections::VecDeque;
use std::time::Duration;

use bytes::Bytes;
use futures_util::StreamExt;
use futures_util::stream::BoxStream;
use reqwest::Method;
use reqwest::header::{ACCEPT, CONTENT_TYPE};
use serde::Deserialize;

use super::client::ANSWERING;
use super::error::of_request;
use super::rooms::about;
use super::sse::{Event, Parser};
use super::{Announcement, Client, HttpError, RoomLink, ServerUrl};

/// A living server says something every 5 s.
const SILENCE: Duration = Duration::from_secs(15);
const STREAM: &str = "text/event-stream";

/// What happens in the room.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PresenceEvent {
    /// A viewer wants to join.
    Offer {
        /// The server's name for it.
        session: String,
        /// What it offers.
        sdp: String,
    },
    /// A viewer has left.
    Leave {
        /// The server's name for it.
        session: String,
    },
    /// Another sender has taken the room; the stream is over.
    Replaced,
}

/// An open presence. Dropping it leaves the room.
pub struct Presence {
    server: ServerUrl,
    stream: BoxStream<'static, reqwest::Result<Bytes>>,
    parser: Parser,
    events: VecDeque<Event>,
}

impl std::fmt::Debug for Presence {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Presence")
            .field("server", &self.server)
            .finish_non_exhaustive()
    }
}

impl Client {
    /// Enters `sender`'s room.
    ///
    /// # Errors
    /// If the server cannot be reached, refuses the link, or does not have the avatar ([`HttpError::NotFound`]).
    pub async fn present(
        &self,
        sender: &RoomLink,
        announcement: &Announcement,
    ) -> Result<Presence, HttpError> {
        let about = about(sender, "entering the room with this avatar");
        let request = self
            .request(&about, Method::POST, &["rooms", sender.room(), "presence"])?
            .header(ACCEPT, STREAM)
            .json(announcement);
        let response = about.send(request, ANSWERING).await?;
        let kind = response
            .headers()
            .get(CONTENT_TYPE)
            .and_then(|kind| kind.to_str().ok());
        if !kind.is_some_and(|kind| kind.starts_with(STREAM)) {
            return Err(about.unintelligible("it is no event stream"));
        }
        Ok(Presence {
            server: sender.server().clone(),
            stream: response.bytes_stream().boxed(),
            parser: Parser::default(),
            events: VecDeque::new(),
        })
    }
}

impl Presence {
    /// The next event. Events of kinds that this program does not know are left out.
    ///
    /// # Errors
    /// If the stream ends, breaks, or is silent for longer than a living server is: be present again.
    pub async fn next(&mut self) -> Result<PresenceEvent, HttpError> {
        loop {
            while let Some(event) = self.events.pop_front() {
                match self.understand(&event)? {
                    Some(event) => return Ok(event),
                    None => log::debug!("an event of kind {:?} is left alone", event.kind),
                }
            }
            let piece = tokio::time::timeout(SILENCE, self.stream.next()).await;
            let server = || self.server.clone();
            match piece {
                Err(_) => {
                    return Err(HttpError::PresenceSilent {
                        server: server(),
                        limit: SILENCE,
                    });
                }
                Ok(None) => return Err(HttpError::PresenceEnded { server: server() }),
                Ok(Some(Err(error))) => return Err(of_request(&self.server, error)),
                Ok(Some(Ok(bytes))) => self
                    .parser
                    .push(&bytes, &mut self.events)
                    .map_err(|_| unintelligible(&self.server, "an event is too long"))?,
            }
        }
    }

    fn understand(&self, event: &Event) -> Result<Option<PresenceEvent>, HttpError> {
        #[derive(Deserialize)]
        struct Offer {
            session: String,
            sdp: String,
        }
        #[derive(Deserialize)]
        struct Leave {
            session: String,
        }
        let wrong = |error: serde_json::Error| unintelligible(&self.server, &error.to_string());
        Ok(match event.kind.as_str() {
            "offer" => {
                let Offer { session, sdp } = serde_json::from_str(&event.data).map_err(wrong)?;
                Some(PresenceEvent::Offer { session, sdp })
            }
            "leave" => {
                let Leave { session } = serde_json::from_str(&event.data).map_err(wrong)?;
                Some(PresenceEvent::Leave { session })
            }
            "replaced" => Some(PresenceEvent::Replaced),
            _ => None,
        })
    }
}

fn unintelligible(server: &ServerUrl, why: &str) -> HttpError {
    HttpError::Unintelligible {
        server: server.clone(),
        what: "the presence",
        why: why.to_owned(),
    }
}
