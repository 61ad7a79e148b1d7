//! The sender's presence: a stream of events that is open while the sender is in the room.

use super::guard::{Client, discard};
use super::rooms::{random, refused, room_of};
use super::{App, HttpError};
use crate::Id;
use crate::ice::TELL_ICE_EVERY;
use crate::packages::Shelf;
use crate::rooms::{
    CallSeats, NotEntered, Occupancy, PresenceGuard, RoomReply, RoomRequest, is_of_another,
};
use crate::token::{Claims, Role, now};
use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{Extension, FromRequest, Path, Request, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{Event as SseEvent, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use link_protocol::calls::{EnterRoom, LeaveSeat};
use link_protocol::limits::{MAX_REVOKED, PRESENCE_COMMENT_EVERY};
use link_protocol::presence::PresenceEvent;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// Sooner than the protocol asks for.
const COMMENT_EVERY: Duration = PRESENCE_COMMENT_EVERY.saturating_sub(Duration::from_secs(1));
/// How long the announcement may take to arrive and to be checked.
const ANNOUNCED_WITHIN: Duration = Duration::from_secs(10);

pub(super) async fn enter(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Extension(client): Extension<Client>,
    Path(room): Path<String>,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, HttpError> {
    // Before the body: a viewer's token is to keep no connection open.
    let room = match room_of(&app, &claims, &[Role::Sender], &room) {
        Ok(room) => room,
        Err(refusal) => {
            discard(request.into_body());
            return Err(refusal);
        }
    };
    let body = tokio::time::timeout(ANNOUNCED_WITHIN, Bytes::from_request(request, &()));
    let body = body.await.map_err(|_| HttpError::TooSlow)?;
    let sender: EnterRoom = serde_json::from_slice(&body?).map_err(HttpError::NoAnnouncement)?;
    if sender.revoked.len() > MAX_REVOKED {
        return Err(HttpError::Revoked);
    }
    let avatar = sender.announcement.avatar;
    if claims.role == Role::Member {
        check_seat(&app, room, &sender)
            .await
            .inspect_err(|refusal| {
                if matches!(refusal, HttpError::SeatTaken) {
                    app.metrics.senders_refused.inc();
                }
            })?;
    }
    let size = app.packages.size(Shelf::of(&claims), avatar.sha256);
    match tokio::time::timeout(ANNOUNCED_WITHIN, size).await {
        Err(_) => return Err(HttpError::StoreSlow),
        Ok(Err(e)) => return Err(e.into()),
        Ok(Ok(None)) => return Err(HttpError::NotFound),
        Ok(Ok(Some(bytes))) if bytes != avatar.bytes => {
            let (found, announced) = (bytes, avatar.bytes);
            return Err(HttpError::AvatarSize { found, announced });
        }
        Ok(Ok(Some(_))) => {}
    }
    let seats = (claims.role == Role::Member).then(|| CallSeats {
        rooms: claims.seats(&app.secret).collect(),
        per_network: claims.seats_per_address().into(),
    });
    let of = Occupancy {
        owner: claims.owner,
        network: (seats.as_ref()).map(|_| app.secret.network(claims.room(), client.address())),
    };
    let (guard, events) = app
        .rooms
        .enter(room, random()?, of, seats.as_ref(), sender)
        .inspect_err(|_| {
            app.metrics.senders_refused.inc();
        })
        .map_err(|refused| match refused {
            NotEntered::TooManyRooms => HttpError::TooManySenders,
            NotEntered::Taken => HttpError::SeatTaken,
            NotEntered::TooManySeats => HttpError::TooManySeats {
                most: claims.seats_per_address(),
            },
        })?;
    if let Some(relay) = &app.relay {
        relay.hold(room, Arc::clone(&guard.presence)).await;
    }
    log::info!("a sender is in room {room}");
    let stream = EventStream {
        replaced: guard.presence.replaced(),
        ends: Instant::now() + Duration::from_secs(claims.expires.saturating_sub(now())),
        stopping: app.stopping.clone(),
        guard,
        events,
        next: Next::Comment,
        app: Arc::clone(&app),
        headers,
        room,
        claims,
        names: claims.names().collect(),
        tell_ice: Instant::now(),
    };
    let keep_alive = KeepAlive::new().interval(COMMENT_EVERY);
    Ok(Sse::new(stream::unfold(stream, EventStream::next))
        .keep_alive(keep_alive)
        .into_response())
}

/// The occupant leaves its seat on purpose.
pub(super) async fn leave(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path(room): Path<String>,
    body: Result<Bytes, BytesRejection>,
) -> Result<StatusCode, HttpError> {
    let seat = room_of(&app, &claims, &[], &room)?;
    let LeaveSeat { occupant } = serde_json::from_slice(&body?).map_err(HttpError::NotLeft)?;
    app.rooms.release(seat, &occupant);
    match app.ask(seat, RoomRequest::LeaveSeat { occupant }).await {
        RoomReply::Done | RoomReply::Absent => Ok(StatusCode::NO_CONTENT),
        other => Err(refused(&other)),
    }
}

/// That a seat is free, or its occupant comes back to it, as far as other instances know. Two newcomers at one moment on two instances are not told apart: the
/// later one replaces the other, who takes another seat.
async fn check_seat(app: &App, room: Id, sender: &EnterRoom) -> Result<(), HttpError> {
    if sender.occupant.is_none() {
        return Err(HttpError::NoOccupant);
    }
    match app
        .ask(room, RoomRequest::Announcement { viewer: None })
        .await
    {
        RoomReply::Announcement { occupant, .. } if is_of_another(occupant.as_ref(), sender) => {
            Err(HttpError::SeatTaken)
        }
        // Whoever sits there may only be slow to say so.
        RoomReply::Unanswered | RoomReply::Busy | RoomReply::Unreachable => {
            Err(HttpError::SenderUnreachable)
        }
        _ => Ok(()),
    }
}

/// The state of the stream. The server drops it when the connection ends, which ends the sender's presence.
struct EventStream {
    events: mpsc::Receiver<PresenceEvent>,
    replaced: CancellationToken,
    stopping: CancellationToken,
    /// When the sender's token expires.
    ends: Instant,
    next: Next,
    guard: PresenceGuard,
    app: Arc<App>,
    /// Of the request, which say by what name the sender reaches this server.
    headers: HeaderMap,
    room: Id,
    /// Of the sender's token.
    claims: Claims,
    /// The names of that token, and of those that it was made with.
    names: Vec<Id>,
    /// When the sender is told the STUN and TURN servers next.
    tell_ice: Instant,
}

/// What the stream writes next.
enum Next {
    /// A comment, because proxies pass nothing on before the first bytes.
    Comment,
    /// That the server forwards, if it does.
    Forwards,
    Event,
    /// That the viewers of these sessions leave, because the sender's token is revoked; then the end.
    Leaves(Vec<Id>),
    /// The end.
    Nothing,
}

impl EventStream {
    async fn next(mut self) -> Option<(Result<SseEvent, Infallible>, Self)> {
        let event = match self.next {
            Next::Comment => {
                self.next = match self.app.forwarding {
                    Some(_) => Next::Forwards,
                    None => Next::Event,
                };
                SseEvent::default().comment("here")
            }
            Next::Forwards => {
                self.next = Next::Event;
                sse(&PresenceEvent::Forwards)
            }
            Next::Event => tokio::select! {
                biased;
                () = self.replaced.cancelled() => {
                    self.next = Next::Nothing;
                    sse(&PresenceEvent::Replaced)
                }
                () = self.stopping.cancelled() => return None,
                // A sender whose token is revoked gets no more events, and does not hold the room.
                () = self.app.revoked.until_any(&self.names) => {
                    self.guard.presence.leave();
                    let sessions = self.app.joined.of_room(self.claims.owner, self.room);
                    self.next = Next::Leaves(sessions);
                    SseEvent::default().comment("revoked")
                }
                () = tokio::time::sleep_until(self.ends) => {
                    self.guard.presence.leave();
                    return None;
                }
                () = tokio::time::sleep_until(self.tell_ice), if self.app.ice.has_any() => {
                    self.tell_ice = Instant::now() + TELL_ICE_EVERY;
                    let servers = self.app.ice.servers(&self.headers, &self.claims);
                    sse(&PresenceEvent::IceServers(servers))
                }
                event = self.events.recv() => sse(&event?),
            },
            Next::Leaves(ref mut sessions) => sse(&PresenceEvent::Leave {
                session: sessions.pop()?.into(),
            }),
            Next::Nothing => return None,
        };
        Some((Ok(event), self))
    }
}

fn sse(event: &PresenceEvent) -> SseEvent {
    let (name, data) = event.write();
    SseEvent::default().event(name).data(data)
}
