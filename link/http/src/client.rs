//! One request and its response: the token in its header, a bound on time and on size, and each refusal as an [`HttpError`]. The
//! requests themselves are in the files beside.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use bytes::Bytes;
use reqwest::{
    Certificate, Method, RequestBuilder, Response, StatusCode,
    header::{AUTHORIZATION, CONTENT_TYPE, HeaderMap, HeaderValue, LOCATION, RETRY_AFTER},
    redirect,
};
use serde::de::DeserializeOwned;
use url::Url;

use crate::{HttpError, error::of_request, roots};
use link_protocol::{
    ProtocolError, Token,
    limits::{MAX_SDP_BYTES, PRESENCE_COMMENT_EVERY},
    room_link::ServerUrl,
    rooms::ErrorBody,
};

/// The largest response that is read whole, in bytes: a server may allow larger SDPs than it does by default.
const MAX_RESPONSE: usize = 4 * MAX_SDP_BYTES;
/// Characters of a server's own sentence that an error repeats.
const MAX_SAID: usize = 300;
/// A connection that has been idle for longer may be dead, and is not used again.
const IDLE: Duration = Duration::from_secs(20);

/// How long a client waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Timeouts {
    /// For a connection.
    pub connect: Duration,
    /// For a response's head; of a small response, for all of it.
    pub response: Duration,
    /// For the next byte of a download, an upload or the presence stream.
    pub idle: Duration,
    /// Over which a download must bring 2 KiB a second: long enough for a network to change or be lost for a moment.
    pub pace: Duration,
    /// For the server to store a package after its last byte was sent.
    pub store: Duration,
    /// Before the first retry of a broken transfer; doubled after each attempt that brought nothing, up to 4 s.
    pub retry: Duration,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self {
            connect: Duration::from_secs(2),
            response: Duration::from_secs(10),
            idle: 3 * PRESENCE_COMMENT_EVERY,
            pace: Duration::from_secs(30),
            store: Duration::from_secs(120),
            retry: Duration::from_millis(250),
        }
    }
}

/// A client of any number of servers. Cheap to clone; clones share their connections.
///
/// It follows no redirect and uses no proxy of the environment's: either would hand a token to another machine.
#[derive(Debug, Clone)]
pub struct Client {
    http: reqwest::Client,
    timeouts: Timeouts,
    /// Certificates that are trusted beside the system's.
    extra: Vec<Certificate>,
}

/// A response that was read whole.
#[derive(Debug)]
pub(crate) struct Reply {
    pub(crate) status: StatusCode,
    pub(crate) headers: HeaderMap,
    pub(crate) body: Vec<u8>,
}

impl Client {
    /// A client that trusts what the system trusts, and the certificates in this PEM file.
    ///
    /// # Errors
    /// [`HttpError::RootCertificate`] if the file cannot be read or holds no certificate, [`HttpError::Setup`] if TLS cannot be set up.
    pub fn new(extra_root_certificate: Option<&Path>) -> Result<Self, HttpError> {
        Self::with_timeouts(extra_root_certificate, Timeouts::default())
    }

    /// As [`Client::new`], with other timeouts.
    ///
    /// # Errors
    /// As [`Client::new`].
    pub fn with_timeouts(
        extra_root_certificate: Option<&Path>,
        timeouts: Timeouts,
    ) -> Result<Self, HttpError> {
        // An error means that the program has installed a provider already; any provider will do.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let extra = extra_root_certificate
            .map(root_certificates)
            .transpose()?
            .unwrap_or_default();
        Self::build(extra, timeouts)
    }

    /// The same client without the connections that it has: they may lead nowhere after this machine's address has changed, which shows in
    /// timeouts only.
    ///
    /// # Errors
    /// [`HttpError::Setup`] if TLS cannot be set up.
    pub fn with_new_connections(&self) -> Result<Self, HttpError> {
        Self::build(self.extra.clone(), self.timeouts)
    }

    fn build(extra: Vec<Certificate>, timeouts: Timeouts) -> Result<Self, HttpError> {
        let builder = || {
            reqwest::Client::builder()
                .connect_timeout(timeouts.connect)
                .pool_idle_timeout(IDLE)
                .redirect(redirect::Policy::none())
                .no_proxy()
                .http1_only()
                .user_agent(concat!("mon3tr/", env!("CARGO_PKG_VERSION")))
        };
        let usual = match roots::of_android() {
            Some(system) => builder().tls_certs_only(system.into_iter().chain(extra.clone())),
            None => builder().tls_certs_merge(extra.clone()),
        };
        let http = usual.build().or_else(|error| {
            // A machine without any certificate authority (a bare container) can still use http.
            log::warn!(
                "only http and servers with a given root certificate can be reached: {}",
                error_text(&error)
            );
            builder().tls_certs_only(extra.clone()).build()
        });
        Ok(Self {
            http: http.map_err(HttpError::Setup)?,
            timeouts,
            extra,
        })
    }

    pub(crate) fn timeouts(&self) -> &Timeouts {
        &self.timeouts
    }

    /// A request to a route below `/v1/`.
    pub(crate) fn request(
        &self,
        method: Method,
        server: &ServerUrl,
        token: &Token,
        segments: &[&str],
    ) -> Result<RequestBuilder, HttpError> {
        Ok(self
            .http
            .request(method, route(server, segments)?)
            .header(AUTHORIZATION, bearer(token)?))
    }

    /// Sends, and waits for the response's head.
    pub(crate) async fn open(
        &self,
        server: &ServerUrl,
        what: &'static str,
        request: RequestBuilder,
    ) -> Result<Response, HttpError> {
        let limit = self.timeouts.response;
        match tokio::time::timeout(limit, request.send()).await {
            Ok(answer) => answer.map_err(|error| of_request(server, error)),
            Err(_) => Err(HttpError::TimedOut {
                server: server.clone(),
                what,
                limit,
            }),
        }
    }

    /// Sends, and waits for the whole response.
    pub(crate) async fn exchange(
        &self,
        server: &ServerUrl,
        what: &'static str,
        request: RequestBuilder,
    ) -> Result<Reply, HttpError> {
        let limit = self.timeouts.response;
        let begun = Instant::now();
        let answer = self.open(server, what, request).await?;
        let left = limit.saturating_sub(begun.elapsed());
        match tokio::time::timeout(left, read_whole(server, what, answer)).await {
            Ok(reply) => reply,
            Err(_) => Err(HttpError::TimedOut {
                server: server.clone(),
                what,
                limit,
            }),
        }
    }

    /// The error that a refusing response is, with the server's sentence if the body arrives in time.
    pub(crate) async fn refusal(
        &self,
        server: &ServerUrl,
        token: &Token,
        what: &'static str,
        answer: Response,
    ) -> HttpError {
        let (status, headers) = (answer.status(), answer.headers().clone());
        let body =
            match tokio::time::timeout(self.timeouts.response, read_whole(server, what, answer))
                .await
            {
                Ok(Ok(reply)) => reply.body,
                // The status alone is enough.
                Ok(Err(_)) | Err(_) => Vec::new(),
            };
        Reply {
            status,
            headers,
            body,
        }
        .refusal(server, token, what)
    }
}

/// The address of a route below `/v1/`. Segments must be checked names.
fn route(server: &ServerUrl, segments: &[&str]) -> Result<Url, HttpError> {
    let text = format!("{server}/v1/{}", segments.join("/"));
    Url::parse(&text).map_err(|error| ProtocolError::Address(error.to_string()).into())
}

/// `Bearer TOKEN`, marked so that no log shows it.
fn bearer(token: &Token) -> Result<HeaderValue, HttpError> {
    let mut value = HeaderValue::try_from(format!("Bearer {}", token.secret()))
        .map_err(|_| ProtocolError::Token("it fits no HTTP header"))?;
    value.set_sensitive(true);
    Ok(value)
}

/// The whole of a response, if it is small.
pub(crate) async fn read_whole(
    server: &ServerUrl,
    what: &'static str,
    mut answer: Response,
) -> Result<Reply, HttpError> {
    let mut body = Vec::new();
    while let Some(piece) = next_piece(server, &mut answer).await? {
        if body.len() + piece.len() > MAX_RESPONSE {
            return Err(invalid_response(
                server,
                what,
                format!("more than {MAX_RESPONSE} bytes"),
            ));
        }
        body.extend_from_slice(&piece);
    }
    Ok(Reply {
        status: answer.status(),
        headers: answer.headers().clone(),
        body,
    })
}

pub(crate) async fn next_piece(
    server: &ServerUrl,
    answer: &mut Response,
) -> Result<Option<Bytes>, HttpError> {
    answer
        .chunk()
        .await
        .map_err(|error| of_request(server, error))
}

pub(crate) fn invalid_response(
    server: &ServerUrl,
    what: &'static str,
    why: impl Into<String>,
) -> HttpError {
    HttpError::InvalidResponse {
        server: server.clone(),
        what,
        why: why.into(),
    }
}

impl Reply {
    /// The JSON that the body is.
    pub(crate) fn json<T: DeserializeOwned>(
        &self,
        server: &ServerUrl,
        token: &Token,
        what: &'static str,
    ) -> Result<T, HttpError> {
        // serde_json repeats wrong values, and one may be the token.
        serde_json::from_slice(&self.body)
            .map_err(|error| invalid_response(server, what, token.redact(&error.to_string())))
    }

    /// The error of a status that is no success.
    pub(crate) fn refusal(
        &self,
        server: &ServerUrl,
        token: &Token,
        what: &'static str,
    ) -> HttpError {
        let (status, server) = (self.status.as_u16(), server.clone());
        let retry_after = self.retry_after();
        match status {
            401 => HttpError::Unauthorized { server },
            404 => HttpError::NotFound {
                server,
                what,
                advice: advice(what),
            },
            409 if what == PRESENCE => HttpError::SeatTaken,
            403 if what == PRESENCE => HttpError::TooManySeats {
                server,
                said: self.said(token),
            },
            413 => HttpError::TooLarge { server, what },
            429 => HttpError::RateLimited {
                server,
                retry_after,
            },
            507 => HttpError::StoreFull { server },
            500..=599 => HttpError::Unavailable {
                server,
                status,
                said: self.said(token),
                retry_after,
            },
            300..=399 => match self.points_to(&server) {
                Some(to) => HttpError::Redirected { server, to },
                None => HttpError::Refused {
                    server,
                    what,
                    status,
                    said: self.said(token),
                },
            },
            _ => HttpError::Refused {
                server,
                what,
                status,
                said: self.said(token),
            },
        }
    }

    /// Whole seconds; a date is ignored, as the protocol has none.
    pub(crate) fn retry_after(&self) -> Option<Duration> {
        let seconds = self
            .headers
            .get(RETRY_AFTER)?
            .to_str()
            .ok()?
            .trim()
            .parse::<u32>()
            .ok()?;
        Some(Duration::from_secs(seconds.into()))
    }

    /// Scheme and host of a redirect: the rest may hold secrets.
    fn points_to(&self, server: &ServerUrl) -> Option<String> {
        let location = self.headers.get(LOCATION)?.to_str().ok()?;
        let to = Url::parse(&server.to_string()).ok()?.join(location).ok()?;
        Some(to.origin().ascii_serialization())
    }

    /// The server's own sentence: short, on one line, without the token.
    fn said(&self, token: &Token) -> String {
        let text = serde_json::from_slice(&self.body).map_or_else(
            |_| {
                let is_text = self
                    .headers
                    .get(CONTENT_TYPE)
                    .is_some_and(|kind| kind.as_bytes().starts_with(b"text/plain"));
                if is_text {
                    String::from_utf8_lossy(&self.body).into_owned()
                } else {
                    "no reason given".to_owned()
                }
            },
            |body: ErrorBody| body.error,
        );
        token
            .redact(&text)
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .take(MAX_SAID)
            .collect()
    }
}

fn advice(what: &'static str) -> &'static str {
    match what {
        CALL => "the call is over or the link is another call's; ask for a new link",
        OPEN_CALL => "check that the token is the owner's, and that the server is of this version",
        ROOM | PRESENCE | OFFER => {
            "the room is gone or the link is another room's; ask for a new link"
        }
        PACKAGE | HAS_PACKAGE => "have the sender upload it again",
        ANSWER => "the viewer does not wait for it any more",
        _ => "check that the token allows this",
    }
}

/// The requests, as error messages name them: `SERVER did not answer within 10 s to {what}`.
pub(crate) const OPEN_ROOM: &str = "open a room";
pub(crate) const ADD_VIEWER: &str = "make a token for one viewer";
pub(crate) const OPEN_CALL: &str = "open a call";
pub(crate) const CALL: &str = "tell who is in the call";
pub(crate) const ROOM: &str = "tell about the room";
pub(crate) const OFFER: &str = "pass on an offer";
pub(crate) const LEAVE: &str = "end the session";
pub(crate) const LEAVE_SEAT: &str = "leave the seat";
pub(crate) const PRESENCE: &str = "note the sender's presence";
pub(crate) const ANSWER: &str = "pass on an answer";
pub(crate) const HAS_PACKAGE: &str = "look for a package";
pub(crate) const PUT_PACKAGE: &str = "take a package";
pub(crate) const PACKAGE: &str = "send a package";

fn root_certificates(path: &Path) -> Result<Vec<Certificate>, HttpError> {
    let wrong = |why: String| HttpError::RootCertificate {
        path: path.to_owned(),
        why,
    };
    let pem = fs::read(path).map_err(|error| wrong(error.to_string()))?;
    let certificates =
        Certificate::from_pem_bundle(&pem).map_err(|error| wrong(error_text(&error)))?;
    if certificates.is_empty() {
        return Err(wrong("no PEM block `CERTIFICATE`".to_owned()));
    }
    Ok(certificates)
}

fn error_text(error: &reqwest::Error) -> String {
    std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string)
}
