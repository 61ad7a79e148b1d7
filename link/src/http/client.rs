//! The HTTP client: how requests are made, and what answers other than success mean.

use std::{path::Path, sync::Once, time::Duration};

use bytes::Bytes;
use futures_util::StreamExt;
use reqwest::header::{AUTHORIZATION, HeaderMap, LOCATION, RETRY_AFTER};
use reqwest::{Method, RequestBuilder, Response, StatusCode, Url, redirect};
use serde::Deserialize;

use super::error::of_request;
use super::room_link::Token;
use super::{HttpError, ServerUrl};

/// How long a connection may take to be made.
const CONNECTING: Duration = Duration::from_secs(2);
/// How long an answer may take; joining waits 5 s for the sender.
pub(super) const ANSWERING: Duration = Duration::from_secs(10);
/// Bytes read of an answer that is not a package.
const MAX_ANSWER: usize = 256 << 10;
/// Characters kept of what a server says of an error.
const MAX_SAID: usize = 300;

/// Speaks HTTP to servers. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Client {
    http: reqwest::Client,
}

/// One request to be made.
pub(super) struct Request<'a> {
    pub(super) server: &'a ServerUrl,
    pub(super) token: &'a Token,
    /// For messages: what is asked for, and what to do if it is not there.
    pub(super) what: &'static str,
    pub(super) advice: &'static str,
}

impl Client {
    /// A client that trusts the system's certificates and, if given, those of a PEM file.
    ///
    /// # Errors
    /// [`HttpError::RootCertificate`] if the file holds none, [`HttpError::Setup`] if TLS cannot be set up.
    pub fn new(extra_root_certificate: Option<&Path>) -> Result<Self, HttpError> {
        // For the whole process; another part of it may have chosen already, which is as good.
        static PROVIDER: Once = Once::new();
        PROVIDER.call_once(|| drop(rustls::crypto::ring::default_provider().install_default()));
        let mut builder = reqwest::Client::builder()
            .connect_timeout(CONNECTING)
            .tcp_nodelay(true)
            // A token goes only where its owner sent it.
            .redirect(redirect::Policy::none());
        if let Some(path) = extra_root_certificate {
            let wrong = |why: String| HttpError::RootCertificate {
                path: path.to_owned(),
                why,
            };
            let pem = std::fs::read(path).map_err(|error| wrong(error.to_string()))?;
            let certificates = reqwest::Certificate::from_pem_bundle(&pem)
                .map_err(|error| wrong(error.to_string()))?;
            if certificates.is_empty() {
                return Err(wrong("there is no certificate in it".into()));
            }
            builder = builder.tls_certs_merge(certificates);
        }
        let http = builder.build().map_err(HttpError::Setup)?;
        Ok(Self { http })
    }

    /// A request to a route below `/v1/`.
    pub(super) fn request(
        &self,
        about: &Request<'_>,
        method: Method,
        segments: &[&str],
    ) -> Result<RequestBuilder, HttpError> {
        let url: Url = about.server.route(segments)?;
        Ok(self
            .http
            .request(method, url)
            .header(AUTHORIZATION, about.token.header()?))
    }
}

impl Request<'_> {
    /// Sends within `limit` and returns a successful answer's head.
    pub(super) async fn send(
        &self,
        request: RequestBuilder,
        limit: Duration,
    ) -> Result<Response, HttpError> {
        let sent = tokio::time::timeout(limit, request.send()).await;
        let response = sent
            .map_err(|_| self.timed_out(limit))?
            .map_err(|error| of_request(self.server, error))?;
        if response.status().is_success() || response.status() == StatusCode::NOT_MODIFIED {
            return Ok(response);
        }
        Err(self.refused(response, limit).await)
    }

    /// The whole of a small answer.
    pub(super) async fn read(
        &self,
        response: Response,
        limit: Duration,
    ) -> Result<Bytes, HttpError> {
        let collect = async {
            let mut all = Vec::new();
            let mut pieces = response.bytes_stream();
            while let Some(piece) = pieces.next().await {
                let piece = piece.map_err(|error| of_request(self.server, error))?;
                if all.len() + piece.len() > MAX_ANSWER {
                    return Err(self.unintelligible("it is far too long"));
                }
                all.extend_from_slice(&piece);
            }
            Ok(Bytes::from(all))
        };
        tokio::time::timeout(limit, collect)
            .await
            .map_err(|_| self.timed_out(limit))?
    }

    /// A small answer's JSON.
    pub(super) async fn read_json<T: for<'a> Deserialize<'a>>(
        &self,
        response: Response,
        limit: Duration,
    ) -> Result<T, HttpError> {
        let bytes = self.read(response, limit).await?;
        serde_json::from_slice(&bytes).map_err(|error| self.unintelligible(&error.to_string()))
    }

    /// A small answer's text.
    pub(super) async fn read_text(
        &self,
        response: Response,
        limit: Duration,
    ) -> Result<String, HttpError> {
        let bytes = self.read(response, limit).await?;
        String::from_utf8(bytes.into()).map_err(|_| self.unintelligible("it is no text"))
    }

    pub(super) fn unintelligible(&self, why: &str) -> HttpError {
        HttpError::Unintelligible {
            server: self.server.clone(),
            what: self.what,
            why: self.token.struck_from(why),
        }
    }

    fn timed_out(&self, limit: Duration) -> HttpError {
        HttpError::TimedOut {
            server: self.server.clone(),
            what: self.what,
            limit,
        }
    }

    async fn refused(&self, response: Response, limit: Duration) -> HttpError {
        #[derive(Deserialize)]
        struct Said {
            error: String,
        }
        let server = self.server.clone();
        let status = response.status();
        let retry_after = retry_after(response.headers());
        if status.is_redirection() {
            return HttpError::Redirected {
                to: origin(response.headers()),
                server,
            };
        }
        let body = self.read(response, limit).await.unwrap_or_default();
        let said = serde_json::from_slice::<Said>(&body).map_or_else(
            |_| String::from_utf8_lossy(&body).into_owned(),
            |said| said.error,
        );
        let said: String = self
            .token
            .struck_from(&said)
            .chars()
            .filter(|c| !c.is_control())
            .take(MAX_SAID)
            .collect();
        match status {
            StatusCode::UNAUTHORIZED => HttpError::NotAccepted { server },
            StatusCode::NOT_FOUND => HttpError::NotFound {
                server,
                what: self.what,
                advice: self.advice,
            },
            StatusCode::TOO_MANY_REQUESTS => HttpError::RateLimited {
                server,
                retry_after,
            },
            StatusCode::PAYLOAD_TOO_LARGE => HttpError::TooLarge {
                server,
                what: self.what,
            },
            StatusCode::INSUFFICIENT_STORAGE => HttpError::StoreFull { server },
            status if status.is_server_error() => HttpError::Unavailable {
                server,
                status: status.as_u16(),
                said,
                retry_after,
            },
            status => HttpError::Refused {
                server,
                what: self.what,
                status: status.as_u16(),
                said,
            },
        }
    }
}

fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    let seconds = headers.get(RETRY_AFTER)?.to_str().ok()?.parse().ok()?;
    Some(Duration::from_secs(seconds))
}

/// Scheme and host of where an answer points.
fn origin(headers: &HeaderMap) -> String {
    let url = headers
        .get(LOCATION)
        .and_then(|l| l.to_str().ok())
        .and_then(|l| Url::parse(l).ok());
    url.map_or_else(
        || "another address".to_owned(),
        |url| url.origin().ascii_serialization(),
    )
}
