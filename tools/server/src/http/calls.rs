//! Calls of several: a call is a name from which its seats follow, each a room of its own. Nothing is kept of a call either: its members' token says which
//! it is, and a seat is taken while its presence stream is open.

use super::rooms::{lifetime_within, no_random, random};
use super::{App, HttpError, NO_STORE};
use crate::Id;
use crate::rooms::{RoomReply, RoomRequest};
use crate::token::{Claims, Role, now};
use axum::Json;
use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use futures_util::future::join_all;
use link_protocol::calls::{CallStatus, OpenCall, OpenedCall, Seat, Taken};
use link_protocol::limits::{MAX_PEOPLE, SEATS_PER_ADDRESS};
use std::sync::Arc;

pub(super) async fn open(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    body: Result<Bytes, BytesRejection>,
) -> Result<Response, HttpError> {
    if claims.role != Role::Owner {
        return Err(HttpError::NotFound);
    }
    let body = body?;
    let order: OpenCall = if body.is_empty() {
        OpenCall::default()
    } else {
        serde_json::from_slice(&body).map_err(HttpError::NoRoomRequest)?
    };
    let lifetime = lifetime_within(&app, order.lifetime_s)?;
    let expires = now().saturating_add(lifetime);
    let seats = order.seats_per_address.unwrap_or(SEATS_PER_ADDRESS);
    if !(1..=MAX_PEOPLE).contains(&seats.into()) {
        return Err(HttpError::SeatsPerAddress);
    }
    let call = random()?;
    let member = Claims::in_room(Role::Member, claims.owner, call, expires).map_err(no_random)?;
    let opened = OpenedCall {
        call: call.into(),
        member_token: (member.made_with(&claims))
            .with_seats_per_address(seats)
            .sign(&app.secret),
        expires,
    };
    Ok((StatusCode::CREATED, NO_STORE, Json(opened)).into_response())
}

pub(super) async fn status(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path(call): Path<String>,
    headers: HeaderMap,
) -> Result<Response, HttpError> {
    let is_theirs = |call| claims.may(&[Role::Member], call);
    if !Id::parse(&call).is_some_and(is_theirs) {
        return Err(HttpError::NotFound);
    }
    let seats = claims.seats(&app.secret).map(|room| seat(&app, room));
    let seats = join_all(seats).await;
    let seats = seats.into_iter().collect::<Result<_, _>>()?;
    let ice_servers = app.ice.servers(&headers, &claims);
    let status = CallStatus { seats, ice_servers };
    Ok((NO_STORE, Json(status)).into_response())
}

async fn seat(app: &App, room: Id) -> Result<Seat, HttpError> {
    let taken = match app
        .ask(room, RoomRequest::Announcement { viewer: None })
        .await
    {
        RoomReply::Announcement {
            announcement,
            person,
            proof,
            ..
        } => Some(Taken {
            announcement,
            person,
            proof,
        }),
        RoomReply::Unreachable => return Err(HttpError::SenderUnreachable),
        _ => None,
    };
    Ok(Seat {
        room: room.into(),
        kept: taken.is_none() && app.rooms.is_kept(room),
        taken,
    })
}
