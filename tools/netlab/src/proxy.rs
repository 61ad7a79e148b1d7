//! A reverse HTTP proxy. Forwards every request to the real server and its answer back, bodies as they come; only the session
//! descriptions of `POST .../whep` (docs/protocol.md) are rewritten, so that the call's packets go through the lab.

use std::{net::SocketAddr, sync::Arc};

use axum::{
    Router,
    body::{Body, to_bytes},
    extract::{Request, State},
    http::{HeaderMap, HeaderValue, Method, StatusCode, Version, header},
    response::Response,
};
use futures_util::StreamExt as _;
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use tokio::{net::TcpStream, sync::watch};

use crate::{NetlabError, calls::Shared, sdp};

/// A session description is some 2 kB; a server takes no more than this either.
const MAX_SDP_BYTES: usize = 64 * 1024;

/// Headers that belong to one connection, not to the message (RFC 9110, section 7.6.1), and `Expect`, which our side has answered.
const OF_ONE_CONNECTION: [header::HeaderName; 6] = [
    header::CONNECTION,
    header::TE,
    header::TRAILER,
    header::TRANSFER_ENCODING,
    header::UPGRADE,
    header::EXPECT,
];

pub(crate) fn router(shared: Arc<Shared>) -> Router {
    Router::new().fallback(handle).with_state(shared)
}

async fn handle(State(shared): State<Arc<Shared>>, request: Request) -> Response {
    let is_call = request.method() == Method::POST && request.uri().path().ends_with("/whep");
    let answer = if is_call {
        call(&shared, request).await
    } else {
        forward(shared.upstream, request).await
    };
    match answer {
        Ok(answer) => until_stopped(answer, shared.stopped.subscribe()),
        Err(error) => {
            log::warn!("netlab: {error}");
            refusal(&error)
        }
    }
}

/// A viewer's call: offer and answer are rewritten to a new pair of sockets.
async fn call(shared: &Arc<Shared>, request: Request) -> Result<Response, NetlabError> {
    let (mut head, body) = request.into_parts();
    let offer = text(body).await?;
    let relay = shared.open_relay()?;
    let offer = sdp::rewrite(&offer, relay.sender_facing())?;
    relay.set_viewer_address(offer.peer);
    head.headers.remove(header::CONTENT_LENGTH);
    // From here on: the sender may begin before its answer is through.
    shared.carry(relay.clone());
    let answer = forward(
        shared.upstream,
        Request::from_parts(head, Body::from(offer.sdp)),
    )
    .await;
    match answer {
        Ok(answer) if answer.status() == StatusCode::CREATED => {
            let (mut head, body) = answer.into_parts();
            let answer = sdp::rewrite(&text(body).await?, relay.viewer_facing())?;
            relay.set_sender_address(answer.peer);
            head.headers.remove(header::CONTENT_LENGTH);
            Ok(Response::from_parts(head, Body::from(answer.sdp)))
        }
        other => {
            shared.close(&relay);
            other
        }
    }
}

async fn text(body: Body) -> Result<String, NetlabError> {
    let bytes = to_bytes(body, MAX_SDP_BYTES)
        .await
        .map_err(|_| NetlabError::Sdp("it broke off or is over 64 KiB"))?;
    String::from_utf8(bytes.into()).map_err(|_| NetlabError::Sdp("it is not UTF-8"))
}

/// One request to the server, over a connection of its own: so it reaches the server of now, and the server sees it
/// when a viewer goes away.
async fn forward(server: SocketAddr, request: Request) -> Result<Response, NetlabError> {
    let fail = |what: &str, error: &dyn std::error::Error| NetlabError::Upstream {
        server,
        why: format!("{what}: {error}"),
    };
    let stream = TcpStream::connect(server)
        .await
        .map_err(|e| fail("connecting", &e))?;
    stream
        .set_nodelay(true)
        .map_err(|e| fail("connecting", &e))?;
    let (mut requests, connection) = http1::handshake::<_, Body>(TokioIo::new(stream))
        .await
        .map_err(|e| fail("connecting", &e))?;
    tokio::spawn(async move {
        if let Err(error) = connection.await {
            log::debug!("netlab: the connection to the server ended: {error}");
        }
    });
    let (mut head, body) = request.into_parts();
    strip(&mut head.headers);
    head.version = Version::HTTP_11;
    let answer = requests
        .send_request(Request::from_parts(head, body))
        .await
        .map_err(|e| fail("asking", &e))?;
    let (mut head, body) = answer.into_parts();
    strip(&mut head.headers);
    Ok(Response::from_parts(head, Body::new(body)))
}

fn strip(headers: &mut HeaderMap) {
    for name in OF_ONE_CONNECTION {
        headers.remove(name);
    }
}

/// Breaks a body off when the lab stops, as a network that is gone would.
fn until_stopped(answer: Response, mut stopped: watch::Receiver<bool>) -> Response {
    let (head, body) = answer.into_parts();
    // An empty body is left as it is: as a stream its end would not be known beforehand.
    if axum::body::HttpBody::is_end_stream(&body) {
        return Response::from_parts(head, body);
    }
    let gone = async move {
        let _ = stopped.wait_for(|&stopped| stopped).await;
    };
    let body = Body::from_stream(body.into_data_stream().take_until(Box::pin(gone)));
    Response::from_parts(head, body)
}

fn refusal(error: &NetlabError) -> Response {
    let status = match error {
        NetlabError::Sdp(_) => StatusCode::BAD_REQUEST,
        _ => StatusCode::BAD_GATEWAY,
    };
    let said = serde_json::json!({ "error": error.to_string() });
    let mut answer = Response::new(Body::from(said.to_string()));
    *answer.status_mut() = status;
    answer.headers_mut().insert(
        header::CONTENT_TYPE,
        HeaderValue::from_static("application/json"),
    );
    answer
}
