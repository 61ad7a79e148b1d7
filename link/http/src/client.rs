//! One request and its answer: the token in its header, a bound on time and on size, and each refusal as a [`HttpError`]. Which
//! requests there are is told in the files beside.

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
    ProtocolError,
    room_link::{ServerUrl, Token},
};

/// No JSON or SDP of the protocol is larger, in bytes.
const MAX_ANSWER: usize = 256 << 10;
/// As much of what a server says for a refusal goes into a message, in characters.
const MAX_SAID: usize = 300;
/// A connection that has been idle for this long may be dead without anybody knowing.
const IDLE: Duration = Duration::from_secs(20);

/// How long a client waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patience {
    /// For a connection.
    pub connect: Duration,
    /// For an answer's head; of a small answer, for all of it.
    pub answer: Duration,
    /// For the next byte of what takes its time: a download, an upload, the presence stream.
    pub silence: Duration,
    /// For the store to take a package in after its last byte was sent.
    pub store: Duration,
    /// Before trying a broken transfer again; doubled each time that nothing came, up to 4 s.
    pub pause: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            connect: Duration::from_secs(2),
            answer: Duration::from_secs(10),
            silence: Duration::from_secs(15),
            store: Duration::from_secs(120),
            pause: Duration::from_millis(250),
        }
    }
}

/// Speaks to servers. Cheap to clone; clones share their connections.
///
/// It follows no redirect and uses no proxy that the environment names: either would hand a token to another machine.
#[derive(Debug, Clone)]
pub struct Client {
    http: reqwest::Client,
    patience: Patience,
}

/// An answer that came whole.
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
    /// [`HttpError::RootCertificate`] if the file is no such file, [`HttpError::Setup`] if TLS cannot be set up.
    pub fn new(extra_root_certificate: Option<&Path>) -> Result<Self, HttpError> {
        Self::with_patience(extra_root_certificate, Patience::default())
    }

    /// As [`Client::new`], with other waits.
    ///
    /// # Errors
    /// As [`Client::new`].
    pub fn with_patience(
        extra_root_certificate: Option<&Path>,
        patience: Patience,
    ) -> Result<Self, HttpError> {
        // An error says that somebody installed one before us; whichever it is will do.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let extra = extra_root_certificate
            .map(root_certificates)
            .transpose()?
            .unwrap_or_default();
        let builder = || {
            reqwest::Client::builder()
                .connect_timeout(patience.connect)
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
            // A machine without any certificate authority (a bare container) can still call by http.
            log::warn!(
                "only http and servers with a given root certificate can be reached: {}",
                error_text(&error)
            );
            builder().tls_certs_only(extra).build()
        });
        Ok(Self {
            http: http.map_err(HttpError::Setup)?,
            patience,
        })
    }

    pub(crate) fn patience(&self) -> &Patience {
        &self.patience
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

    /// Sends, and waits for the answer's head.
    pub(crate) async fn open(
        &self,
        server: &ServerUrl,
        what: &'static str,
        request: RequestBuilder,
    ) -> Result<Response, HttpError> {
        let limit = self.patience.answer;
        match tokio::time::timeout(limit, request.send()).await {
            Ok(answer) => answer.map_err(|error| of_request(server, error)),
            Err(_) => Err(HttpError::TimedOut {
                server: server.clone(),
                what,
                limit,
            }),
        }
    }

    /// Sends, and waits for the whole answer.
    pub(crate) async fn exchange(
        &self,
        server: &ServerUrl,
        what: &'static str,
        request: RequestBuilder,
    ) -> Result<Reply, HttpError> {
        let limit = self.patience.answer;
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

    /// The refusal that an answer is, if its body comes in time.
    pub(crate) async fn refusal(
        &self,
        server: &ServerUrl,
        token: &Token,
        what: &'static str,
        answer: Response,
    ) -> HttpError {
        let (status, headers) = (answer.status(), answer.headers().clone());
        let body = match tokio::time::timeout(
            self.patience.answer,
            read_whole(server, what, answer),
        )
        .await
        {
            Ok(Ok(reply)) => reply.body,
            // The status alone says enough.
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

/// The whole of an answer, if it is small.
pub(crate) async fn read_whole(
    server: &ServerUrl,
    what: &'static str,
    mut answer: Response,
) -> Result<Reply, HttpError> {
    let mut body = Vec::new();
    while let Some(piece) = next_piece(server, &mut answer).await? {
        if body.len() + piece.len() > MAX_ANSWER {
            return Err(unintelligible(
                server,
                what,
                format!("more than {MAX_ANSWER} bytes"),
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

pub(crate) fn unintelligible(
    server: &ServerUrl,
    what: &'static str,
    why: impl Into<String>,
) -> HttpError {
    HttpError::Unintelligible {
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
        // serde_json cites wrong values.
        serde_json::from_slice(&self.body)
            .map_err(|error| unintelligible(server, what, token.struck_from(&error.to_string())))
    }

    /// What this status means where it is no success.
    pub(crate) fn refusal(
        &self,
        server: &ServerUrl,
        token: &Token,
        what: &'static str,
    ) -> HttpError {
        let (status, server) = (self.status.as_u16(), server.clone());
        let retry_after = self.retry_after();
        match status {
            401 => HttpError::NotAccepted { server },
            404 => HttpError::NotFound {
                server,
                what,
                advice: advice(what),
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

    /// Whole seconds, as the protocol's server says them; a date is left unread.
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

    /// The server's own sentence, fit to be shown: short, on one line, without the token.
    fn said(&self, token: &Token) -> String {
        #[derive(serde::Deserialize)]
        struct Said {
            error: String,
        }
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
            |said: Said| said.error,
        );
        token
            .struck_from(&text)
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .take(MAX_SAID)
            .collect()
    }
}

fn advice(what: &'static str) -> &'static str {
    match what {
        ROOM | PRESENCE | OFFER => {
            "the room is gone or the link is for another; ask for a new link"
        }
        PACKAGE | HAS_PACKAGE => "have the sender upload it again",
        ANSWER => "the viewer no longer waits",
        _ => "check that the token is meant for this",
    }
}

/// What is asked of a server, as messages name it.
pub(crate) const OPEN_ROOM: &str = "open a room";
pub(crate) const ROOM: &str = "tell about the room";
pub(crate) const OFFER: &str = "pass on an offer";
pub(crate) const LEAVE: &str = "end the session";
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
