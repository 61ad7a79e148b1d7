//! The routes. Every request passes, from outside in: the counters, the rate limit, CORS, its token, its timeout.

mod calls;
mod error;
mod guard;
mod health;
mod joined;
mod member_uploads;
mod packages;
mod presence;
mod rate_limit;
mod rooms;
mod senders_room;

use crate::blocked::Blocked;
use crate::connections::Gate;
use crate::forwarding::{Forwarding, SendersRoom};
use crate::ice::Ice;
use crate::metrics::Metrics;
use crate::packages::Packages;
use crate::relay::Relay;
use crate::revoked::Revoked;
use crate::rooms::{RoomReply, RoomRequest, Rooms};
use crate::{Id, Limits, Secret};
use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::http::{HeaderName, HeaderValue, Method, header};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{get, post, put};
use error::HttpError;
pub(crate) use health::Cached;
pub(crate) use joined::Joined;
use link_protocol::limits::MAX_JSON_BYTES;
use member_uploads::MemberUploads;
pub(crate) use rate_limit::RateLimit;
use senders_room::RoomHere;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;
use tower_http::cors::{Any, CorsLayer};

/// For answers with a token, or about a person.
const NO_STORE: [(HeaderName, HeaderValue); 1] =
    [(header::CACHE_CONTROL, HeaderValue::from_static("no-store"))];

/// What the handlers share.
#[derive(Debug)]
pub(crate) struct App {
    pub(crate) limits: Limits,
    pub(crate) secret: Secret,
    pub(crate) revoked: Arc<Revoked>,
    pub(crate) blocked: Arc<Blocked>,
    pub(crate) gate: Gate,
    /// Sessions that end with their token.
    pub(crate) joined: Joined,
    pub(crate) rooms: Arc<Rooms>,
    pub(crate) relay: Option<Relay>,
    pub(crate) ice: Ice,
    pub(crate) forwarding: Option<Arc<dyn Forwarding>>,
    pub(crate) packages: Packages,
    pub(crate) member_uploads: Arc<MemberUploads>,
    pub(crate) metrics: Arc<Metrics>,
    pub(crate) rate: RateLimit,
    pub(crate) health: Cached,
    /// The server is stopping: streams end.
    pub(crate) stopping: CancellationToken,
}

impl App {
    /// Asks the room's sender, on whichever instance it is connected.
    async fn ask(&self, room: Id, request: RoomRequest) -> RoomReply {
        match (self.rooms.presence(room), &self.relay) {
            (Some(presence), _) => presence.ask(request).await,
            (None, Some(relay)) => relay.ask(room, &request).await,
            (None, None) => RoomReply::Absent,
        }
    }

    /// Ends what came about by tokens that are revoked now: relays at once; of viewers' sessions, those that are
    /// forwarded to, and by the senders the others.
    pub(crate) fn end_revoked(self: &Arc<Self>) {
        if let Some(relay) = self.ice.relay() {
            relay.end_refused();
        }
        let over = self.joined.newly_over(|names| self.revoked.has_any(names));
        if over.is_empty() {
            return;
        }
        log::info!(
            "{} viewers are sent away: their tokens are revoked",
            over.len()
        );
        let mut rooms = HashMap::<Id, Vec<Id>>::new();
        for (room, session) in over {
            if let Some(forwarding) = &self.forwarding {
                forwarding.leave(&session.into());
            }
            rooms.entry(room).or_default().push(session);
        }
        for (room, sessions) in rooms {
            let room = RoomHere::new(self, room);
            // Each for itself: a sender that takes nothing keeps no other waiting.
            tokio::spawn(async move {
                for session in sessions {
                    room.left(&session.into()).await;
                }
            });
        }
    }

    /// Ends the connections and relays of addresses that are blocked now.
    pub(crate) fn end_blocked(&self) {
        self.gate.close_blocked();
        if let Some(relay) = self.ice.relay() {
            relay.end_refused();
        }
    }
}

/// All routes with their layers.
pub(crate) fn router(app: Arc<App>) -> Router {
    let within = app.limits.request_within;
    let sdp = app.limits.sdp_bytes;
    let short = Router::new()
        .route("/v1/rooms", post(rooms::open))
        .route("/v1/rooms/{room}", get(rooms::status))
        .route("/v1/rooms/{room}/viewers", post(rooms::add_viewer))
        .route("/v1/packages", get(packages::list))
        .route("/v1/calls", post(calls::open))
        .route("/v1/calls/{call}", get(calls::status))
        .route(
            "/v1/rooms/{room}/sessions/{session}",
            axum::routing::delete(rooms::leave),
        )
        .route(
            "/v1/rooms/{room}/presence",
            axum::routing::delete(presence::leave),
        )
        .layer(DefaultBodyLimit::max(MAX_JSON_BYTES));
    let offers = Router::new()
        .route("/v1/rooms/{room}/whep", post(rooms::join))
        .route(
            "/v1/rooms/{room}/sessions/{session}/answer",
            put(rooms::answer),
        )
        .layer(DefaultBodyLimit::max(sdp));
    // These bound their own time: they last as long as a call or a transfer does.
    let long = Router::new()
        .route(
            "/v1/rooms/{room}/presence",
            post(presence::enter).layer(DefaultBodyLimit::max(MAX_JSON_BYTES)),
        )
        .route(
            "/v1/packages/{hash}",
            get(packages::read)
                .put(packages::store)
                .delete(packages::remove),
        );
    let router = short
        .merge(offers)
        .layer(from_fn(move |request, next| {
            guard::within(within, request, next)
        }))
        .merge(long)
        .route("/healthz", get(health::lives))
        .route("/readyz", get(health::is_ready));
    #[cfg(feature = "metrics")]
    let router = router.route("/metrics", get(health::metrics));
    router
        .fallback(async || HttpError::NotFound)
        .method_not_allowed_fallback(async || HttpError::NoMethod)
        .layer(from_fn_with_state(Arc::clone(&app), guard::authenticate))
        .layer(cors())
        .layer(from_fn_with_state(Arc::clone(&app), guard::limit_rate))
        .layer(from_fn_with_state(Arc::clone(&app), guard::count))
        .with_state(app)
}

/// Any page may call this server: a token gives its rights from any page, and there are no cookies.
fn cors() -> CorsLayer {
    CorsLayer::new()
        .allow_origin(Any)
        .allow_methods([
            Method::GET,
            Method::HEAD,
            Method::POST,
            Method::PUT,
            Method::DELETE,
        ])
        .allow_headers([
            header::AUTHORIZATION,
            header::CONTENT_TYPE,
            header::RANGE,
            header::IF_RANGE,
            header::IF_NONE_MATCH,
        ])
        .expose_headers([
            header::LOCATION,
            header::ETAG,
            header::ACCEPT_RANGES,
            header::CONTENT_RANGE,
            header::CONTENT_LENGTH,
            header::RETRY_AFTER,
        ])
        .max_age(Duration::from_secs(3600))
}
