//! A sender's presence in its room: a stream of events that is open for as long as the sender is in the room. It does not reconnect by
//! itself: the caller opens another one.

use std::collections::VecDeque;

use reqwest::{
    Method, Response, StatusCode,
    header::{ACCEPT, CONTENT_TYPE},
};
use tokio::time::Instant;

use crate::{
    Client, HttpError,
    client::{PRESENCE, Timeouts, invalid_response, next_piece},
    sse::{Event, Parser},
};
use link_protocol::{RoomLink, calls::EnterRoom, presence::PresenceEvent, room_link::ServerUrl};

/// An open presence. Dropping it ends it.
#[derive(Debug)]
pub struct Presence {
    server: ServerUrl,
    stream: Response,
    parser: Parser,
    ready: VecDeque<Event>,
    /// When bytes last arrived.
    last_heard: Instant,
    timeouts: Timeouts,
    ended: bool,
}

impl Client {
    /// Enters the sender's room as its sender. A sender that is there already is replaced, and gets an event that says so.
    ///
    /// # Errors
    /// [`ProtocolError::Announcement`](link_protocol::ProtocolError::Announcement) if it is out of bounds, [`HttpError::NotFound`] if the room is gone or its owner has no such
    /// package (upload it first), [`HttpError::SeatTaken`] if it is the seat of a call and another's, and those of any request.
    pub async fn open_presence(
        &self,
        sender: &RoomLink,
        entering: &EnterRoom,
    ) -> Result<Presence, HttpError> {
        entering.announcement.checked()?;
        let server = sender.server();
        let request = self
            .request(
                Method::POST,
                server,
                sender.token(),
                &["rooms", sender.room().as_str(), "presence"],
            )?
            .header(ACCEPT, "text/event-stream")
            .json(entering);
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
            return Err(invalid_response(server, PRESENCE, "no text/event-stream"));
        }
        Ok(Presence {
            server: server.clone(),
            stream,
            parser: Parser::default(),
            ready: VecDeque::new(),
            last_heard: Instant::now(),
            timeouts: *self.timeouts(),
            ended: false,
        })
    }
}

impl Presence {
    /// Waits for the next event. May be cancelled, in `select!`, without losing one.
    ///
    /// # Errors
    /// [`HttpError::PresenceSilent`] if nothing, not even a comment, has arrived for [`Timeouts::idle`], [`HttpError::PresenceEnded`] once the
    /// stream is over, [`HttpError::ConnectionLost`] if it was cut, [`HttpError::InvalidResponse`] for an event that is none of the protocol's.
    pub async fn next(&mut self) -> Result<PresenceEvent, HttpError> {
        loop {
            while let Some(event) = self.ready.pop_front() {
                // A later version may send other events.
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
            let limit = self.timeouts.idle;
            let piece = tokio::time::timeout_at(
                self.last_heard + limit,
                next_piece(&self.server, &mut self.stream),
            )
            .await
            .map_err(|_| HttpError::PresenceSilent {
                server: self.server.clone(),
                limit,
            })??;
            self.last_heard = Instant::now();
            match piece {
                Some(piece) => self.parser.push(&piece, &mut self.ready).map_err(|_| {
                    invalid_response(&self.server, PRESENCE, "an event that is too long")
                })?,
                None => self.ended = true,
            }
        }
    }

    fn read(&self, event: &Event) -> Result<Option<PresenceEvent>, HttpError> {
        PresenceEvent::read(&event.kind, &event.data).map_err(|error| {
            invalid_response(
                &self.server,
                PRESENCE,
                format!("in `{}`: {error}", event.kind),
            )
        })
    }
}
