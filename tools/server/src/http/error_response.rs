//! The response to a request that fails: a status and one sentence as JSON.

use axum::Json;
use axum::extract::rejection::BytesRejection;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use link_protocol::rooms::ErrorBody;

/// A response that is no success.
#[derive(Debug)]
pub(crate) struct ErrorResponse {
    status: StatusCode,
    error: String,
    retry_after_s: Option<u32>,
}

impl ErrorResponse {
    pub(crate) fn new(status: StatusCode, error: impl Into<String>) -> Self {
        Self {
            status,
            error: error.into(),
            retry_after_s: None,
        }
    }

    /// Says when to try again.
    pub(crate) fn retry_after(mut self, seconds: u32) -> Self {
        self.retry_after_s = Some(seconds);
        self
    }

    /// The same for what does not exist and for what the token does not allow, so that a client cannot distinguish them.
    pub(crate) fn not_found() -> Self {
        Self::new(StatusCode::NOT_FOUND, "it does not exist for this token")
    }

    pub(crate) fn unauthorized() -> Self {
        Self::new(
            StatusCode::UNAUTHORIZED,
            "this needs a valid token, as `Authorization: Bearer TOKEN`",
        )
    }

    pub(crate) fn absent() -> Self {
        Self::new(
            StatusCode::SERVICE_UNAVAILABLE,
            "the sender is absent; try again",
        )
        .retry_after(1)
    }

    pub(crate) fn busy(error: &str) -> Self {
        Self::new(StatusCode::SERVICE_UNAVAILABLE, error).retry_after(2)
    }

    /// The store failed. The reason goes to the log only.
    pub(crate) fn store(error: &crate::packages::StoreError) -> Self {
        log::error!("the package store fails: {error}");
        Self::busy("the server's package store does not answer")
    }
}

impl From<BytesRejection> for ErrorResponse {
    fn from(rejection: BytesRejection) -> Self {
        match rejection.status() {
            StatusCode::PAYLOAD_TOO_LARGE => Self::new(
                StatusCode::PAYLOAD_TOO_LARGE,
                "the body is longer than this request may have",
            ),
            status => Self::new(status, "the body ended before its end"),
        }
    }
}

impl IntoResponse for ErrorResponse {
    fn into_response(self) -> Response {
        let body = Json(ErrorBody { error: self.error });
        let mut response = (self.status, body).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Some(seconds) = self.retry_after_s {
            headers.insert(header::RETRY_AFTER, seconds.into());
        }
        if self.status == StatusCode::UNAUTHORIZED {
            let bearer = HeaderValue::from_static("Bearer");
            headers.insert(header::WWW_AUTHENTICATE, bearer);
        }
        response
    }
}
