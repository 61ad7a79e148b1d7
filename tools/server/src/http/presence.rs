//! The sender's presence: a stream of events that is open for as long as the sender is there.

use super::rooms::{random, room_of};
use super::{App, Refusal};
use crate::rooms::{Announcement, Event, Stay};
use crate::token::{Claims, Role, now};
use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{Extension, Path, State};
use axum::http::StatusCode;
use axum::response::sse::{Event as SseEvent, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// The page promises a comment every 5 s.
const COMMENT_EVERY: Duration = Duration::from_secs(4);
/// How long the announcement may take to arrive and to be checked.
const ANNOUNCED_WITHIN: Duration = Duration::from_secs(10);

pub(super) async fn enter(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path(room): Path<String>,
    body: Result<Bytes, BytesRejection>,
) -> Result<Response, Refusal> {
    let room = room_of(&claims, &[Role::Sender], &room)?;
    let announcement: Announcement = serde_json::from_slice(&body?).map_err(|e| {
        let error = format!("the body is no announcement: {e}");
        Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error)
    })?;
    if !(1.0..=240.0).contains(&announcement.rate_hz) {
        let error = "an announcement's rate_hz is from 1 to 240";
        return Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error));
    }
    let avatar = announcement.avatar;
    let size = app.packages.size(claims.owner, avatar.sha256);
    match tokio::time::timeout(ANNOUNCED_WITHIN, size).await {
        Err(_) => return Err(Refusal::busy("the server's package store is slow")),
        Ok(Err(e)) => return Err(Refusal::store(&e)),
        Ok(Ok(None)) => return Err(Refusal::not_found()),
        Ok(Ok(Some(bytes))) if bytes != avatar.bytes => {
            let error = format!("the avatar has {bytes} bytes, not {}", avatar.bytes);
            return Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error));
        }
        Ok(Ok(Some(_))) => {}
    }
    let (stay, events) = app
        .rooms
        .enter(room, random()?, claims.owner, announcement)
        .map_err(|_| Refusal::busy("too many senders are connected"))?;
    if let Some(relay) = &app.relay {
        relay.hold(room, Arc::clone(&stay.presence)).await;
    }
    log::info!("a sender is in room {room}");
    let told = Told {
        replaced: stay.presence.replaced(),
        ends: Instant::now() + Duration::from_secs(claims.expires.saturating_sub(now())),
        stopping: app.stopping.clone(),
        _stay: stay,
        events,
        at: At::Beginning,
    };
    let keep_alive = KeepAlive::new().interval(COMMENT_EVERY);
    Ok(Sse::new(stream::unfold(told, Told::next))
        .keep_alive(keep_alive)
        .into_response())
}

/// What the stream is made of. Dropping it, as the server does when the connection ends, ends the sender's stay.
struct Told {
    events: mpsc::Receiver<Event>,
    replaced: CancellationToken,
    stopping: CancellationToken,
    /// When the sender's token expires.
    ends: Instant,
    at: At,
    _stay: Stay,
}

enum At {
    Beginning,
    Middle,
    End,
}

impl Told {
    async fn next(mut self) -> Option<(Result<SseEvent, Infallible>, Self)> {
        let event = match self.at {
            // Proxies pass nothing on before there is something.
            At::Beginning => {
                self.at = At::Middle;
                SseEvent::default().comment("here")
            }
            At::Middle => tokio::select! {
                biased;
                () = self.replaced.cancelled() => {
                    self.at = At::End;
                    SseEvent::default().event("replaced").data("{}")
                }
                () = self.stopping.cancelled() => return None,
                () = tokio::time::sleep_until(self.ends) => return None,
                event = self.events.recv() => sse(&event?),
            },
            At::End => return None,
        };
        Some((Ok(event), self))
    }
}

fn sse(event: &Event) -> SseEvent {
    let data = |name: &str, data: serde_json::Value| {
        SseEvent::default().event(name).data(data.to_string())
    };
    match event {
        Event::Offer { session, sdp } => data(
            "offer",
            serde_json::json!({ "session": session, "sdp": sdp }),
        ),
        Event::Leave { session } => data("leave", serde_json::json!({ "session": session })),
    }
}
