//! The layers that every request passes before its handler: counters, the rate limit, the token, the timeout.

use super::{App, HttpError};
use crate::metrics::TokenRefusal;
use crate::token::{Claims, now};
use axum::body::Body;
use axum::extract::{ConnectInfo, Extension, MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderValue, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Bytes and time that a refused request may go on sending, so that its client reads the refusal instead of a broken connection.
const DISCARDED_BYTES: usize = 4 << 20;
const DISCARDED_WITHIN: Duration = Duration::from_secs(5);

/// What requests are logged under.
const ACCESS: &str = "access";

const FORWARDED_FOR: &str = "x-forwarded-for";

/// Where a request comes from: the connection's address, or what the proxy before this server says.
#[derive(Clone, Copy)]
pub(super) struct Client(pub(super) IpAddr);

impl Client {
    pub(super) fn address(self) -> IpAddr {
        self.0
    }
}

/// Finds out where a request comes from, counts it and writes it to the log, with nothing that is secret: the route's pattern and no room, no token.
pub(super) async fn count(
    State(app): State<Arc<App>>,
    ConnectInfo(address): ConnectInfo<SocketAddr>,
    mut request: Request,
    next: Next,
) -> Response {
    let begun = Instant::now();
    let client = client(&app, address.ip(), request.headers());
    request.extensions_mut().insert(Client(client));
    let route = request.extensions().get::<MatchedPath>().cloned();
    let method = request.method().clone();
    let response = next.run(request).await;
    let route = route.as_ref().map_or("other", MatchedPath::as_str);
    let status = response.status().as_u16();
    app.metrics.request(route, status);
    let ms = begun.elapsed().as_millis();
    log::info!(target: ACCESS, "client={client} method={method} route={route} status={status} ms={ms}");
    response
}

/// Behind a proxy the last address that it added to the header counts: those before are what the client said.
fn client(app: &App, connected: IpAddr, headers: &HeaderMap) -> IpAddr {
    if !app.limits.behind_proxy {
        return connected;
    }
    let mut lines = headers.get_all(FORWARDED_FOR).iter();
    let last = lines.next_back().and_then(|line| line.to_str().ok());
    let last = last.and_then(|line| line.rsplit(',').next());
    last.and_then(|address| address.trim().parse().ok())
        .unwrap_or(connected)
}

/// Refuses requests of blocked addresses, and such as come too fast: also those by which a browser asks what it may
/// send, which go no further.
pub(super) async fn limit_rate(
    State(app): State<Arc<App>>,
    Extension(Client(address)): Extension<Client>,
    request: Request,
    next: Next,
) -> Response {
    // Behind a proxy the connection does not tell where a request comes from.
    let refusal = if app.blocked.has(address) {
        app.metrics.blocked.inc();
        HttpError::Blocked
    } else if let Err(retry_after_s) = app.rate.check(address) {
        app.metrics.rate_limited.inc();
        HttpError::TooManyRequests { retry_after_s }
    } else {
        return next.run(request).await;
    };
    let mut response = refusal.into_response();
    // As all answers have it, so that a page reads why.
    let headers = response.headers_mut();
    let any = HeaderValue::from_static("*");
    headers.insert(header::ACCESS_CONTROL_ALLOW_ORIGIN, any.clone());
    headers.insert(header::ACCESS_CONTROL_EXPOSE_HEADERS, any);
    response
}

pub(super) async fn authenticate(
    State(app): State<Arc<App>>,
    ConnectInfo(connection): ConnectInfo<SocketAddr>,
    mut request: Request,
    next: Next,
) -> Response {
    if matches!(request.uri().path(), "/healthz" | "/readyz" | "/metrics") {
        return next.run(request).await;
    }
    let token = bearer(request.headers());
    let has_token = token.is_some();
    let claims = token.and_then(|token| Claims::verify(token, &app.secret, now()));
    let refused = match claims {
        Some(claims) if !app.revoked.has_any(claims.names()) => {
            request.extensions_mut().insert(claims);
            let response = next.run(request).await;
            if response.status().is_success() {
                app.gate.trust(&connection);
            }
            return response;
        }
        Some(_) => TokenRefusal::Revoked,
        None if has_token => TokenRefusal::Invalid,
        None => TokenRefusal::Missing,
    };
    app.metrics.token_refused(refused);
    discard(request.into_body());
    HttpError::Unauthorized.into_response()
}

/// The one token of a request.
fn bearer(headers: &HeaderMap) -> Option<&str> {
    let mut values = headers.get_all(header::AUTHORIZATION).iter();
    let value = values.next()?.to_str().ok()?;
    let (scheme, token) = value.split_once(' ')?;
    let only = values.next().is_none() && scheme.eq_ignore_ascii_case("bearer");
    only.then(|| token.trim())
}

pub(super) async fn within(limit: Duration, request: Request, next: Next) -> Response {
    match tokio::time::timeout(limit, next.run(request)).await {
        Ok(response) => response,
        Err(_) => HttpError::TooSlow.into_response(),
    }
}

/// Reads a refused request's body for a while. A connection that is closed with unread bytes is reset, and the response may be lost with
/// it.
pub(super) fn discard(body: Body) {
    let mut body = body.into_data_stream();
    let read_on = async move {
        let mut left = DISCARDED_BYTES;
        while let Some(Ok(chunk)) = body.next().await {
            match left.checked_sub(chunk.len()) {
                Some(rest) => left = rest,
                None => break,
            }
        }
    };
    tokio::spawn(tokio::time::timeout(DISCARDED_WITHIN, read_on));
}
