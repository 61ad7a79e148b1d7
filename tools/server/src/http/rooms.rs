//! Opening rooms, joining them, leaving them, and the sender's answers.

use super::{App, Refusal};
use crate::Id;
use crate::rooms::{Ask, Reply};
use crate::token::{Claims, Role, now};
use axum::body::Bytes;
use axum::extract::rejection::BytesRejection;
use axum::extract::{Extension, Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Json, http::HeaderValue};
use serde::Deserialize;
use std::sync::Arc;

type Body = Result<Bytes, BytesRejection>;

/// An order for a room.
#[derive(Debug, Deserialize)]
struct Order {
    #[serde(default = "a_day")]
    lifetime_s: u64,
}

fn a_day() -> u64 {
    86400
}

pub(super) async fn open(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    body: Body,
) -> Result<Response, Refusal> {
    if claims.role != Role::Owner {
        return Err(Refusal::not_found());
    }
    let body = body?;
    let order = if body.is_empty() {
        Order {
            lifetime_s: a_day(),
        }
    } else {
        serde_json::from_slice(&body).map_err(|e| {
            let error = format!("the body is no order for a room: {e}");
            Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error)
        })?
    };
    let longest = app.limits.room_lifetime.as_secs();
    if order.lifetime_s == 0 || order.lifetime_s > longest {
        let error = format!("a room's lifetime_s is 1 to {longest}");
        return Err(Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, error));
    }
    let room = random()?;
    let expires = now().saturating_add(order.lifetime_s);
    let token = |role| Claims::in_room(role, claims.owner, room, expires).sign(&app.secret);
    let opened = serde_json::json!({
        "room": room,
        "sender_token": token(Role::Sender),
        "viewer_token": token(Role::Viewer),
        "expires": expires,
    });
    let no_store = [(header::CACHE_CONTROL, HeaderValue::from_static("no-store"))];
    Ok((StatusCode::CREATED, no_store, Json(opened)).into_response())
}

pub(super) async fn announcement(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path(room): Path<String>,
) -> Result<Response, Refusal> {
    let room = room_of(&claims, &[Role::Viewer, Role::Sender], &room)?;
    match app.ask(room, Ask::Announcement).await {
        Reply::Announcement { announcement } => {
            let no_store = [(header::CACHE_CONTROL, HeaderValue::from_static("no-store"))];
            Ok((no_store, Json(announcement)).into_response())
        }
        other => Err(refused(&other)),
    }
}

pub(super) async fn join(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path(room): Path<String>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Refusal> {
    let room = room_of(&claims, &[Role::Viewer], &room)?;
    let sdp = sdp(&headers, body)?;
    let session = random()?;
    match app.ask(room, Ask::Offer { session, sdp }).await {
        Reply::Answer { sdp } => {
            app.metrics.viewers_joined.inc();
            let headers = [
                (header::CONTENT_TYPE, "application/sdp".to_owned()),
                (header::CACHE_CONTROL, "no-store".to_owned()),
                (
                    header::LOCATION,
                    format!("/v1/rooms/{room}/sessions/{session}"),
                ),
            ];
            Ok((StatusCode::CREATED, headers, sdp).into_response())
        }
        other => Err(refused(&other)),
    }
}

pub(super) async fn answer(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path((room, session)): Path<(String, String)>,
    headers: HeaderMap,
    body: Body,
) -> Result<StatusCode, Refusal> {
    let room = room_of(&claims, &[Role::Sender], &room)?;
    let session = Id::parse(&session).ok_or_else(Refusal::not_found)?;
    let sdp = sdp(&headers, body)?;
    match app.ask(room, Ask::Answer { session, sdp }).await {
        Reply::Done => Ok(StatusCode::NO_CONTENT),
        // Without a presence nobody waits, either.
        Reply::Absent => Err(refused(&Reply::Unknown)),
        other => Err(refused(&other)),
    }
}

/// A session that the sender never heard of is left as any other: nothing is kept of sessions here.
pub(super) async fn leave(
    State(app): State<Arc<App>>,
    Extension(claims): Extension<Claims>,
    Path((room, session)): Path<(String, String)>,
) -> Result<StatusCode, Refusal> {
    let room = room_of(&claims, &[Role::Viewer], &room)?;
    let session = Id::parse(&session).ok_or_else(Refusal::not_found)?;
    match app.ask(room, Ask::Leave { session }).await {
        Reply::Done => Ok(StatusCode::NO_CONTENT),
        other => Err(refused(&other)),
    }
}

/// The room of a path, if the bearer is one of `roles` there.
pub(super) fn room_of(claims: &Claims, roles: &[Role], room: &str) -> Result<Id, Refusal> {
    Id::parse(room)
        .filter(|room| claims.may(roles, *room))
        .ok_or_else(Refusal::not_found)
}

pub(super) fn random() -> Result<Id, Refusal> {
    Id::random().map_err(|e| {
        log::error!("{e}");
        Refusal::busy("the server has no random numbers at this moment")
    })
}

fn sdp(headers: &HeaderMap, body: Body) -> Result<String, Refusal> {
    let kind = headers.get(header::CONTENT_TYPE);
    let kind = kind.and_then(|value| value.to_str().ok()).unwrap_or("");
    let essence = kind.split(';').next().unwrap_or("").trim();
    if !essence.eq_ignore_ascii_case("application/sdp") {
        return Err(Refusal::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "the body has to be SDP, and its Content-Type application/sdp",
        ));
    }
    String::from_utf8(body?.into())
        .ok()
        .filter(|sdp| sdp.starts_with("v=0"))
        .ok_or_else(|| Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, "the body is not SDP"))
}

fn refused(reply: &Reply) -> Refusal {
    match reply {
        Reply::Unanswered => Refusal::new(
            StatusCode::GATEWAY_TIMEOUT,
            "the sender did not answer in time",
        ),
        Reply::Busy => Refusal::busy("too many viewers are joining at once; try again"),
        Reply::Unknown => Refusal::new(StatusCode::NOT_FOUND, "nobody waits for this answer"),
        Reply::Unreachable => Refusal::busy(
            "the sender is not on this server, and the other servers cannot be reached; try again",
        ),
        Reply::Absent => Refusal::absent(),
        Reply::Announcement { .. } | Reply::Answer { .. } | Reply::Done => {
            log::error!("an instance answers what was not asked");
            Refusal::absent()
        }
    }
}
