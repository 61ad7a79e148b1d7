//! Opening rooms, joining them, leaving them, and the sender's answers.

use super::guard::Client;
use super::senders_room::RoomHere;
use super::{App, HttpError, NO_STORE};
use crate::forwarding::{HandedOver, SendersRoom};
use crate::metrics::OfferRefusal;
use crate::rooms::{RoomReply, RoomRequest};
use crate::token::{Claims, Role, now};
use crate::{Id, ServerError};
use axum::Json;
use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use link_protocol::limits::DEFAULT_ROOM_LIFETIME;
use link_protocol::rooms::{OpenRoom, OpenedRoom, RoomStatus, SDP_MEDIA_TYPE, ViewerToken};
use link_protocol::{Refusal, sealed};
use std::sync::Arc;

type Body = Result<Bytes, BytesRejection>;

pub(super) async fn open(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    body: Body,
) -> Result<Response, HttpError> {
    if claims.role != Role::Owner {
        return Err(HttpError::NotFound);
    }
    let lifetime = lifetime_of(&app, &body?)?;
    let room = random()?;
    let expires = now().saturating_add(lifetime);
    let token = |role| Ok::<_, HttpError>(sign(&app, role, &claims, room, expires)?.1);
    let opened = OpenedRoom {
        room: room.into(),
        sender_token: token(Role::Sender)?,
        viewer_token: token(Role::Viewer)?,
        expires,
    };
    Ok((StatusCode::CREATED, NO_STORE, Json(opened)).into_response())
}

/// One more viewer's token, which the sender can revoke by itself.
pub(super) async fn add_viewer(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path(room): Path<String>,
    body: Body,
) -> Result<Response, HttpError> {
    let room = Id::parse(&room)
        .filter(|room| claims.may(&[Role::Sender], *room))
        .ok_or(HttpError::NotFound)?;
    // Nobody gives more than they have.
    let expires = match order_of(&app, &body?)?.lifetime_s {
        Some(lifetime) => now().saturating_add(lifetime).min(claims.expires),
        None => claims.expires,
    };
    let (name, viewer_token) = sign(&app, Role::Viewer, &claims, room, expires)?;
    let added = ViewerToken {
        name: name.into(),
        viewer_token,
        expires,
    };
    Ok((StatusCode::CREATED, NO_STORE, Json(added)).into_response())
}

/// A new token, made with `other`: its name and its text.
pub(super) fn sign(
    app: &App,
    role: Role,
    other: &Claims,
    room: Id,
    expires: u64,
) -> Result<(Id, String), HttpError> {
    let claims = Claims::in_room(role, other.owner, room, expires).map_err(no_random)?;
    let claims = claims.made_with(other);
    Ok((claims.name, claims.sign(&app.secret)))
}

/// The lifetime that the body of a request for a room asks for, seconds.
fn lifetime_of(app: &App, body: &[u8]) -> Result<u64, HttpError> {
    lifetime_within(app, order_of(app, body)?.lifetime_s)
}

/// The lifetime of a room or a call for which this one is asked, seconds.
pub(super) fn lifetime_within(app: &App, asked: Option<u64>) -> Result<u64, HttpError> {
    let longest = app.limits.room_lifetime.as_secs();
    match asked {
        Some(lifetime) if lifetime == 0 || lifetime > longest => {
            Err(HttpError::RoomLifetime { longest })
        }
        Some(lifetime) => Ok(lifetime),
        None => Ok(DEFAULT_ROOM_LIFETIME.as_secs().min(longest)),
    }
}

fn order_of(app: &App, body: &[u8]) -> Result<OpenRoom, HttpError> {
    let order: OpenRoom = if body.is_empty() {
        OpenRoom::default()
    } else {
        serde_json::from_slice(body).map_err(HttpError::NoRoomRequest)?
    };
    lifetime_within(app, order.lifetime_s)?;
    Ok(order)
}

pub(super) async fn status(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path(room): Path<String>,
    headers: HeaderMap,
) -> Result<Response, HttpError> {
    let room = room_of(&app, &claims, &[Role::Viewer, Role::Sender], &room)?;
    let viewer = viewer_of(&claims);
    match app.ask(room, RoomRequest::Announcement { viewer }).await {
        RoomReply::Announcement { announcement, .. } => {
            let status = RoomStatus {
                announcement,
                ice_servers: app.ice.servers(&headers, &claims),
            };
            Ok((NO_STORE, Json(status)).into_response())
        }
        other => Err(refused(&other)),
    }
}

pub(super) async fn join(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Extension(client): Extension<Client>,
    Path(room): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, HttpError> {
    let room = room_of(&app, &claims, &[Role::Viewer], &room)?;
    let sdp = sdp(&headers, body)?;
    let session = random()?;
    let offer = app.forwarding.is_some().then(|| sdp.clone());
    let network = app.secret.network(room, client.address());
    let request = RoomRequest::Offer {
        session,
        sdp,
        forwards: false,
        viewer: viewer_of(&claims),
        network: Some(network),
    };
    match app.ask(room, request).await {
        RoomReply::Answer { sdp } => {
            let handed_over = match (&app.forwarding, offer) {
                (Some(forwarding), Some(offer)) if Refusal::read(&sdp) == Some(Refusal::Full) => {
                    let viewer = HandedOver {
                        room: Box::new(RoomHere::new(&app, room)),
                        session: session.into(),
                        offer,
                        network: network.into(),
                    };
                    let (forwarding, app) = (Arc::clone(forwarding), Arc::clone(&app));
                    // Also if the viewer's request ends meanwhile: the sender counts on being told that it has left.
                    let taking = tokio::spawn(async move {
                        let taken = forwarding.take(viewer).await;
                        if taken.is_none() {
                            RoomHere::new(&app, room).left(&session.into()).await;
                        }
                        taken
                    });
                    let taken = taking.await.unwrap_or_else(|error| {
                        log::error!("a viewer could not be handed over: {error}");
                        None
                    });
                    taken.map(|answer| sealed::with_exchange(&answer, &sdp))
                }
                _ => None,
            };
            // Else the viewer is told that there are too many.
            let sdp = handed_over.unwrap_or(sdp);
            // Who waits to be let in is refused every other second.
            if Refusal::read(&sdp).is_none() {
                app.metrics.viewers_joined.inc();
                app.joined.add(&claims, room, session, now());
            }
            let headers = [
                (header::CONTENT_TYPE, SDP_MEDIA_TYPE.to_owned()),
                (header::CACHE_CONTROL, "no-store".to_owned()),
                (
                    header::LOCATION,
                    format!("/v1/rooms/{room}/sessions/{session}"),
                ),
            ];
            Ok((StatusCode::CREATED, headers, sdp).into_response())
        }
        other => {
            match &other {
                RoomReply::Busy => app.metrics.offer_refused(OfferRefusal::Busy),
                RoomReply::Unanswered => app.metrics.offer_refused(OfferRefusal::Unanswered),
                _ => {}
            }
            Err(refused(&other))
        }
    }
}

pub(super) async fn answer(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Extension(client): Extension<Client>,
    Path((room, session)): Path<(String, String)>,
    headers: HeaderMap,
    body: Body,
) -> Result<StatusCode, HttpError> {
    let room = room_of(&app, &claims, &[Role::Sender], &room)?;
    let session = Id::parse(&session).ok_or(HttpError::NotFound)?;
    let sdp = sdp(&headers, body)?;
    match app.ask(room, RoomRequest::Answer { session, sdp }).await {
        RoomReply::Done => {
            // The viewer's offer has counted. Where the answers did, too, offers from two networks would keep the
            // sender from answering those from a third.
            app.rate.give_back(client.address());
            Ok(StatusCode::NO_CONTENT)
        }
        // Without a presence no viewer waits.
        RoomReply::Absent => Err(refused(&RoomReply::Unknown)),
        other => Err(refused(&other)),
    }
}

/// A session that never was is ended like any other: the server keeps nothing of sessions.
pub(super) async fn leave(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path((room, session)): Path<(String, String)>,
) -> Result<StatusCode, HttpError> {
    let room = room_of(&app, &claims, &[Role::Viewer, Role::Sender], &room)?;
    let session = Id::parse(&session).ok_or(HttpError::NotFound)?;
    if let Some(forwarding) = &app.forwarding {
        forwarding.leave(&session.into());
    }
    if claims.role == Role::Sender {
        // It knows.
        return Ok(StatusCode::NO_CONTENT);
    }
    match app.ask(room, RoomRequest::Leave { session }).await {
        RoomReply::Done => Ok(StatusCode::NO_CONTENT),
        other => Err(refused(&other)),
    }
}

/// The room of a path, if the bearer is one of `roles` there. A member of a call is sender and viewer in all of its seats.
pub(super) fn room_of(
    app: &App,
    claims: &Claims,
    roles: &[Role],
    room: &str,
) -> Result<Id, HttpError> {
    Id::parse(room)
        .filter(|room| claims.may(roles, *room) || claims.has_seat(&app.secret, *room))
        .ok_or(HttpError::NotFound)
}

/// What a viewer's token is called; a sender does not revoke others.
pub(super) fn viewer_of(claims: &Claims) -> Option<Id> {
    (claims.role == Role::Viewer).then_some(claims.name)
}

pub(super) fn random() -> Result<Id, HttpError> {
    Id::random().map_err(no_random)
}

pub(super) fn no_random(error: ServerError) -> HttpError {
    log::error!("{error}");
    HttpError::NoRandom
}

fn sdp(headers: &HeaderMap, body: Body) -> Result<String, HttpError> {
    let kind = headers.get(header::CONTENT_TYPE);
    let kind = kind.and_then(|value| value.to_str().ok()).unwrap_or("");
    let essence = kind.split(';').next().unwrap_or("").trim();
    if !essence.eq_ignore_ascii_case(SDP_MEDIA_TYPE) {
        return Err(HttpError::NoSdpType);
    }
    String::from_utf8(body?.into())
        .ok()
        .filter(|sdp| sdp.starts_with("v=0"))
        .ok_or(HttpError::NoSdp)
}

pub(super) fn refused(reply: &RoomReply) -> HttpError {
    match reply {
        RoomReply::Unanswered => HttpError::SenderSilent,
        RoomReply::Busy => HttpError::TooManyViewers,
        RoomReply::Unknown => HttpError::NoViewerWaits,
        RoomReply::Unreachable => HttpError::SenderUnreachable,
        RoomReply::Revoked => HttpError::Unauthorized,
        RoomReply::Absent => HttpError::SenderAbsent,
        RoomReply::Announcement { .. } | RoomReply::Answer { .. } | RoomReply::Done => {
            log::error!("an instance sent the reply of another request");
            HttpError::SenderAbsent
        }
    }
}
