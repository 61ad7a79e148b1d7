//! Every error that a client can be answered: its sentence, its status, and when to try again. Why an upload is refused:
//! [`UploadError`].

use crate::packages::{StoreError, UploadError};
use axum::Json;
use axum::extract::rejection::BytesRejection;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use link_protocol::limits::{MAX_PEOPLE, MAX_REVOKED};
use link_protocol::rooms::ErrorBody;

/// A response that is no success. Its text is the body, as JSON.
#[derive(Debug, thiserror::Error)]
pub(crate) enum HttpError {
    /// The same for what does not exist and for what the token does not allow, so that a client cannot distinguish them.
    #[error("it does not exist for this token")]
    NotFound,
    #[error("there is no such method here")]
    NoMethod,
    #[error("this needs a valid token, as `Authorization: Bearer TOKEN`")]
    Unauthorized,
    #[error("too many requests from this address")]
    TooManyRequests { retry_after_s: u32 },
    #[error("this server does not serve this address")]
    Blocked,
    #[error("this request took too long")]
    TooSlow,
    #[error("the body is longer than this request may have")]
    TooLong,
    #[error("the body ended before its end")]
    Truncated(StatusCode),

    #[error("the body is not a request for a room: {0}")]
    NoRoomRequest(serde_json::Error),
    #[error("a room's lifetime_s is 1 to {longest}")]
    RoomLifetime { longest: u64 },
    #[error("the body has to be SDP, and its Content-Type application/sdp")]
    NoSdpType,
    #[error("the body is not SDP")]
    NoSdp,
    #[error("the sender is absent; try again")]
    SenderAbsent,
    #[error("the sender did not answer in time")]
    SenderSilent,
    #[error("the sender is not on this server, and the other servers cannot be reached; try again")]
    SenderUnreachable,
    #[error("too many viewers are joining at once; try again")]
    TooManyViewers,
    #[error("no viewer waits for this answer")]
    NoViewerWaits,

    #[error("the body is not an announcement: {0}")]
    NoAnnouncement(serde_json::Error),
    #[error("the avatar has {found} bytes, not {announced}")]
    AvatarSize { found: u64, announced: u64 },
    #[error("too many senders are connected")]
    TooManySenders,
    #[error("someone else sits there; take another seat")]
    SeatTaken,
    #[error(
        "this network address has {most} seats of the call, and may have no more; the call's opener can allow more (`call --seats-per-address`)"
    )]
    TooManySeats { most: u8 },
    #[error("one network address may have 1 to {MAX_PEOPLE} seats of a call")]
    SeatsPerAddress,
    #[error("the body does not say who leaves the seat: {0}")]
    NotLeft(serde_json::Error),
    #[error("whoever takes a seat of a call has to name an `occupant`")]
    NoOccupant,
    #[error("a sender may revoke the tokens of {MAX_REVOKED} viewers")]
    Revoked,
    #[error("too many uploads of this call were begun from this address")]
    TooManyTries { retry_after_s: u32 },
    #[error("this call's members have put {most} packages, and may put no more")]
    CallUploads { most: u32 },

    #[error(transparent)]
    Upload(#[from] UploadError),
    #[error("the package has {bytes} bytes")]
    Range { bytes: u64 },
    #[error("the server's package store is slow")]
    StoreSlow,
    /// The store failed. The reason goes to the log only.
    #[error("the server's package store does not answer")]
    StoreSilent,
    #[error("the server has no random numbers at this moment")]
    NoRandom,

    #[error("the server is stopping")]
    Stopping,
    #[error("no connection to NATS: only rooms of this instance are served")]
    NoNats,
    #[error("the package store does not answer")]
    UnhealthyStore,
}

/// When to try again after what lasts a moment, seconds.
const SOON: u32 = 2;

impl HttpError {
    fn status(&self) -> StatusCode {
        match self {
            Self::NotFound | Self::NoViewerWaits => StatusCode::NOT_FOUND,
            Self::NoMethod => StatusCode::METHOD_NOT_ALLOWED,
            Self::Unauthorized => StatusCode::UNAUTHORIZED,
            Self::TooManyRequests { .. } | Self::TooManyTries { .. } => {
                StatusCode::TOO_MANY_REQUESTS
            }
            Self::TooSlow => StatusCode::REQUEST_TIMEOUT,
            Self::TooLong => StatusCode::PAYLOAD_TOO_LARGE,
            Self::Truncated(status) => *status,
            Self::NoRoomRequest(_)
            | Self::RoomLifetime { .. }
            | Self::NoSdp
            | Self::NoAnnouncement(_)
            | Self::NoOccupant
            | Self::NotLeft(_)
            | Self::SeatsPerAddress
            | Self::Revoked
            | Self::AvatarSize { .. } => StatusCode::UNPROCESSABLE_ENTITY,
            Self::SeatTaken => StatusCode::CONFLICT,
            Self::Blocked | Self::CallUploads { .. } | Self::TooManySeats { .. } => {
                StatusCode::FORBIDDEN
            }
            Self::NoSdpType => StatusCode::UNSUPPORTED_MEDIA_TYPE,
            Self::SenderSilent => StatusCode::GATEWAY_TIMEOUT,
            Self::Range { .. } => StatusCode::RANGE_NOT_SATISFIABLE,
            Self::Upload(error) => match error {
                UploadError::TooLarge { .. } => StatusCode::PAYLOAD_TOO_LARGE,
                UploadError::Truncated => StatusCode::BAD_REQUEST,
                UploadError::Paused | UploadError::Slow => StatusCode::REQUEST_TIMEOUT,
                UploadError::Hash { .. } | UploadError::Package(_) => {
                    StatusCode::UNPROCESSABLE_ENTITY
                }
                UploadError::DiskFull => StatusCode::INSUFFICIENT_STORAGE,
                UploadError::Quota(_) => StatusCode::FORBIDDEN,
                UploadError::Busy | UploadError::Spool(_) | UploadError::Store(_) => {
                    StatusCode::SERVICE_UNAVAILABLE
                }
            },
            Self::SenderAbsent
            | Self::SenderUnreachable
            | Self::TooManyViewers
            | Self::TooManySenders
            | Self::StoreSlow
            | Self::StoreSilent
            | Self::NoRandom
            | Self::Stopping
            | Self::NoNats
            | Self::UnhealthyStore => StatusCode::SERVICE_UNAVAILABLE,
        }
    }

    fn retry_after_s(&self) -> Option<u32> {
        match self {
            Self::TooManyRequests { retry_after_s } | Self::TooManyTries { retry_after_s } => {
                Some(*retry_after_s)
            }
            Self::SenderAbsent => Some(1),
            error if error.status() == StatusCode::SERVICE_UNAVAILABLE => Some(SOON),
            _ => None,
        }
    }
}

impl From<StoreError> for HttpError {
    fn from(error: StoreError) -> Self {
        log::error!("the package store fails: {error}");
        Self::StoreSilent
    }
}

impl From<BytesRejection> for HttpError {
    fn from(rejection: BytesRejection) -> Self {
        match rejection.status() {
            StatusCode::PAYLOAD_TOO_LARGE => Self::TooLong,
            status => Self::Truncated(status),
        }
    }
}

impl IntoResponse for HttpError {
    fn into_response(self) -> Response {
        let status = self.status();
        let error = self.to_string();
        let mut response = (status, Json(ErrorBody { error })).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Some(seconds) = self.retry_after_s() {
            headers.insert(header::RETRY_AFTER, seconds.into());
        }
        if status == StatusCode::UNAUTHORIZED {
            let bearer = HeaderValue::from_static("Bearer");
            headers.insert(header::WWW_AUTHENTICATE, bearer);
        }
        response
    }
}
