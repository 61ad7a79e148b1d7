//! A server of packages whose next answers a test sets in advance.

use std::{
    collections::VecDeque,
    net::{Ipv4Addr, SocketAddr},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use axum::{
    Router,
    body::{Body, Bytes},
    extract::State,
    http::{HeaderMap, Method, Response, StatusCode, Uri, header},
};
use futures_util::{StreamExt, stream};
use link_protocol::{PackageId, RoomLink, announcement::AvatarRef, room_link::ServerUrl};

/// Unlikely to be anywhere by chance.
pub(crate) const TOKEN: &str = "v1.viewer-Zm9vYmFyYmF6cXV4.MAC_0123456789abcdef";

/// What is wrong with an answer.
#[derive(Debug, Clone)]
pub(crate) enum Fault {
    None,
    /// The connection breaks after so many bytes of the body.
    Cut(usize),
    /// As `Cut`, but the answer looks complete: it states no length.
    EndsEarly(usize),
    /// Nothing comes after so many bytes.
    Stall(usize),
    /// So many bytes a piece, with a pause after each.
    Slow(usize, Duration),
    /// One byte of the body is another.
    WrongByte,
    /// The stated and the true length of the body.
    Length(usize),
    /// As `Length`, without a stated length.
    LengthUntold(usize),
    /// The whole package, whatever was asked for.
    IgnoresRange,
    /// Another part than was asked for.
    OtherRange,
    /// The answer claims to be gzip and is not.
    CallsItGzip,
    Status(u16, &'static str),
    /// A redirect to this address.
    Redirect(String),
    /// It repeats the request's Authorization header in an error.
    Echo,
}

/// A request as it came.
#[derive(Debug, Clone)]
pub(crate) struct Request {
    pub(crate) method: Method,
    pub(crate) path: String,
    pub(crate) headers: HeaderMap,
    pub(crate) body: usize,
}

impl Request {
    pub(crate) fn header(&self, name: header::HeaderName) -> Option<&str> {
        self.headers
            .get(name)
            .map(|value| value.to_str().expect("text"))
    }
}

#[derive(Debug, Default)]
struct Inner {
    package: Bytes,
    has_it: bool,
    faults: VecDeque<Fault>,
    requests: Vec<Request>,
}

#[derive(Debug, Clone)]
pub(crate) struct Server {
    pub(crate) address: SocketAddr,
    inner: Arc<Mutex<Inner>>,
}

impl Server {
    /// A server with this package, whose first answers are `faults`; those after are right.
    pub(crate) async fn start(package: Vec<u8>, faults: impl IntoIterator<Item = Fault>) -> Self {
        let listener = tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, 0))
            .await
            .expect("a port");
        let inner = Inner {
            package: package.into(),
            has_it: true,
            faults: faults.into_iter().collect(),
            requests: Vec::new(),
        };
        let server = Self {
            address: listener.local_addr().expect("bound"),
            inner: Arc::new(Mutex::new(inner)),
        };
        let router = Router::new().fallback(answer).with_state(server.clone());
        tokio::spawn(async move { axum::serve(listener, router).await });
        server
    }

    pub(crate) async fn without_package(faults: impl IntoIterator<Item = Fault>) -> Self {
        let server = Self::start(Vec::new(), faults).await;
        server.inner().has_it = false;
        server
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn url(&self) -> ServerUrl {
        format!("http://{}", self.address)
            .parse()
            .expect("an address")
    }

    pub(crate) fn link(&self) -> RoomLink {
        format!("{}/rooms/R-1#{TOKEN}", self.url())
            .parse()
            .expect("a link")
    }

    pub(crate) fn avatar(&self) -> AvatarRef {
        let inner = self.inner();
        AvatarRef {
            sha256: PackageId::of_bytes(&inner.package),
            bytes: inner.package.len() as u64,
        }
    }

    pub(crate) fn requests(&self) -> Vec<Request> {
        self.inner().requests.clone()
    }

    /// What each GET asked for.
    pub(crate) fn ranges(&self) -> Vec<Option<String>> {
        let gets = self
            .requests()
            .into_iter()
            .filter(|request| request.method == Method::GET);
        gets.map(|request| request.header(header::RANGE).map(str::to_owned))
            .collect()
    }
}

/// Bytes that neither compress nor repeat.
pub(crate) fn random_bytes(seed: u64, count: usize) -> Vec<u8> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut bytes = vec![0; count];
    random.fill(&mut bytes);
    bytes
}

async fn answer(
    State(server): State<Server>,
    method: Method,
    uri: Uri,
    headers: HeaderMap,
    body: Body,
) -> Response<Body> {
    let Ok(body) = axum::body::to_bytes(body, 1 << 30).await else {
        return status(400, "the body broke");
    };
    let request = Request {
        method: method.clone(),
        path: uri.path().to_owned(),
        headers,
        body: body.len(),
    };
    let (package, fault, has_it) = {
        let mut inner = server.inner();
        inner.requests.push(request.clone());
        (
            inner.package.clone(),
            inner.faults.pop_front().unwrap_or(Fault::None),
            inner.has_it,
        )
    };
    match &fault {
        Fault::Status(code, text) => return status(*code, text),
        Fault::Redirect(to) => {
            let builder = Response::builder().status(307).header(header::LOCATION, to);
            return builder.body(Body::empty()).expect("a response");
        }
        Fault::Echo => {
            let said = request.header(header::AUTHORIZATION).unwrap_or_default();
            let body = format!("{{\"error\": \"you said\\n {said}\"}}");
            return Response::builder()
                .status(418)
                .body(body.into())
                .expect("a response");
        }
        Fault::Cut(_) if method == Method::PUT => {
            return broken_body(
                Response::builder().header(header::CONTENT_LENGTH, 10),
                Bytes::new(),
            );
        }
        _ => {}
    }
    if method == Method::PUT {
        let mut inner = server.inner();
        if PackageId::of_bytes(&body).to_string()
            != request.path.rsplit('/').next().unwrap_or_default()
        {
            return status(400, "another hash");
        }
        (inner.package, inner.has_it) = (body, true);
        return status(201, "");
    }
    if !has_it
        || !request
            .path
            .ends_with(&format!("/v1/packages/{}", PackageId::of_bytes(&package)))
    {
        return status(404, "nothing like that");
    }
    package_answer(&package, &fault, &request)
}

fn package_answer(package: &Bytes, fault: &Fault, request: &Request) -> Response<Body> {
    let id = PackageId::of_bytes(package);
    let first: Option<usize> = request
        .header(header::RANGE)
        .filter(|_| !matches!(fault, Fault::IgnoresRange))
        .and_then(|range| {
            range
                .strip_prefix("bytes=")?
                .strip_suffix('-')?
                .parse()
                .ok()
        });
    assert!(
        request.header(header::RANGE).is_none()
            || request.header(header::IF_RANGE) == Some(&format!("\"{id}\"")),
        "a range is asked for only of this very package"
    );
    let mut builder = Response::builder().header(header::ETAG, format!("\"{id}\""));
    let mut body = package.clone();
    if let Some(first) = first {
        let told = if matches!(fault, Fault::OtherRange) {
            first / 2
        } else {
            first
        };
        let range = format!("bytes {told}-{}/{}", package.len() - 1, package.len());
        builder = builder
            .status(StatusCode::PARTIAL_CONTENT)
            .header(header::CONTENT_RANGE, range);
        body = body.split_off(first);
    }
    let length = body.len();
    let resized = |to: usize| {
        let mut bytes = body.to_vec();
        bytes.resize(to, 0);
        Bytes::from(bytes)
    };
    match *fault {
        Fault::Cut(after) => broken_body(
            builder.header(header::CONTENT_LENGTH, length),
            body.slice(..after.min(length)),
        ),
        Fault::EndsEarly(after) => streamed(builder, vec![body.slice(..after)], Duration::ZERO),
        Fault::LengthUntold(to) => streamed(builder, vec![resized(to)], Duration::ZERO),
        Fault::Length(to) => builder.body(Body::from(resized(to))).expect("a response"),
        Fault::Stall(after) => {
            let pieces = stream::iter([Ok::<_, std::io::Error>(body.slice(..after))])
                .chain(stream::pending());
            builder
                .header(header::CONTENT_LENGTH, length)
                .body(Body::from_stream(pieces))
                .expect("a response")
        }
        Fault::Slow(piece, pause) => {
            let pieces = body.chunks(piece).map(Bytes::copy_from_slice).collect();
            streamed(
                builder.header(header::CONTENT_LENGTH, length),
                pieces,
                pause,
            )
        }
        Fault::WrongByte => {
            let mut bytes = body.to_vec();
            bytes[length / 2] ^= 1;
            builder.body(bytes.into()).expect("a response")
        }
        Fault::CallsItGzip => builder
            .header(header::CONTENT_ENCODING, "gzip")
            .body(body.into())
            .expect("a response"),
        _ => builder.body(body.into()).expect("a response"),
    }
}

fn broken_body(builder: axum::http::response::Builder, body: Bytes) -> Response<Body> {
    let end = stream::once(async {
        // So that what came before has left.
        tokio::time::sleep(Duration::from_millis(30)).await;
        Err(std::io::Error::other("cut"))
    });
    builder
        .body(Body::from_stream(stream::iter([Ok(body)]).chain(end)))
        .expect("a response")
}

fn streamed(
    builder: axum::http::response::Builder,
    pieces: Vec<Bytes>,
    pause: Duration,
) -> Response<Body> {
    let pieces = stream::iter(pieces).then(move |piece| async move {
        tokio::time::sleep(pause).await;
        Ok::<_, std::io::Error>(piece)
    });
    builder.body(Body::from_stream(pieces)).expect("a response")
}

pub(crate) fn status(code: u16, text: &str) -> Response<Body> {
    let builder = Response::builder()
        .status(code)
        .header(header::CONTENT_TYPE, "application/json");
    builder
        .body(format!("{{\"error\": \"{text}\"}}").into())
        .expect("a response")
}
