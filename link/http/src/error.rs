//! The errors of the HTTP client, each with what to do about it. No message holds a token.

use std::{error::Error, fmt::Write, io, path::PathBuf, time::Duration};

use link_protocol::{PackageId, ProtocolError, room_link::ServerUrl};

/// Why a request or a download failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HttpError {
    /// A text or a value that is not one of the protocol's.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The HTTP client could not be made.
    #[error("the HTTP client could not be set up")]
    Setup(#[source] reqwest::Error),
    /// A file with an additional root certificate cannot be used.
    #[error("{} holds no root certificate ({why}): give a PEM file", path.display())]
    RootCertificate {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// No server answers at the address.
    #[error(
        "cannot reach {server}: check the address, and that the server runs and no firewall is in between"
    )]
    Unreachable {
        /// The server.
        server: ServerUrl,
        /// What the network says.
        #[source]
        source: reqwest::Error,
    },
    /// The server's certificate is not one this machine trusts.
    #[error(
        "{server} has a certificate that this machine does not trust: if it is your own server, give the certificate of the authority that signed it"
    )]
    Untrusted {
        /// The server.
        server: ServerUrl,
        /// What TLS says.
        #[source]
        source: reqwest::Error,
    },
    /// The server speaks no TLS.
    #[error(
        "what answers at {server} speaks no TLS: if it is a server of your own without a certificate, its address begins with http://"
    )]
    NoTls {
        /// The server.
        server: ServerUrl,
        /// What TLS says.
        #[source]
        source: reqwest::Error,
    },
    /// The server did not answer in time.
    #[error("{server} did not answer within {} s to {what}: try again", limit.as_secs_f32())]
    TimedOut {
        /// The server.
        server: ServerUrl,
        /// What was asked of it.
        what: &'static str,
        /// How long it had.
        limit: Duration,
    },
    /// The server sends a package so slowly that it would not end in any time worth waiting for.
    #[error(
        "{server} sends the package too slowly, less than 2 KiB a second over {} s: try again later or by another network; what came is kept for the next download",
        over.as_secs_f32()
    )]
    TooSlow {
        /// The server.
        server: ServerUrl,
        /// For how long.
        over: Duration,
    },
    /// The connection broke during the response.
    #[error("the connection to {server} broke: try again")]
    ConnectionLost {
        /// The server.
        server: ServerUrl,
        /// What the network says; nothing where the response ended early.
        #[source]
        source: Option<reqwest::Error>,
    },
    /// 401: the token is not genuine, or has expired.
    #[error(
        "{server} does not accept this token: it has expired, is incomplete, or is another server's; ask for a new one where you got it"
    )]
    Unauthorized {
        /// The server.
        server: ServerUrl,
    },
    /// 404: what was asked for does not exist, or this token has no right to it.
    #[error("{server} has nothing for this token there ({what}): {advice}")]
    NotFound {
        /// The server.
        server: ServerUrl,
        /// What was asked for.
        what: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// 409: the seat of a call is another person's.
    #[error("someone else sits there: take another seat")]
    SeatTaken,
    /// 403 to a member: its network has as many seats of the call as it may have.
    #[error("{server} gives this network no other seat of the call: {said}")]
    TooManySeats {
        /// The server.
        server: ServerUrl,
        /// What the server says.
        said: String,
    },
    /// 503 to an offer: the sender is absent.
    #[error("the sender is not in the room now: wait until it is")]
    SenderAbsent {
        /// How long the server says to wait.
        retry_after: Option<Duration>,
    },
    /// 504 to an offer: the sender is in the room but did not answer in time.
    #[error("the sender is in the room but did not answer the call: try again")]
    SenderTimedOut,
    /// 429: too many requests.
    #[error("{server} has had too many requests from here: wait{}", waiting(*retry_after))]
    RateLimited {
        /// The server.
        server: ServerUrl,
        /// How long the server says to wait.
        retry_after: Option<Duration>,
    },
    /// The server redirects to another address, which the token is not sent to.
    #[error(
        "{server} redirects to {to}, and the token is not sent there: if that is the server, use its address"
    )]
    Redirected {
        /// The server.
        server: ServerUrl,
        /// Where it points: scheme and host only.
        to: String,
    },
    /// 413: the server takes no package of this size.
    #[error(
        "{server} does not take {what} of this size: make it smaller, or raise the server's limit"
    )]
    TooLarge {
        /// The server.
        server: ServerUrl,
        /// What was sent.
        what: &'static str,
    },
    /// 507: the store is full.
    #[error("the store of {server} is full: delete packages there, or give it more room")]
    StoreFull {
        /// The server.
        server: ServerUrl,
    },
    /// A 5xx that is not about the sender.
    #[error(
        "{server} cannot do this now (HTTP {status}: {said}): try again, or look into the server's log"
    )]
    Unavailable {
        /// The server.
        server: ServerUrl,
        /// The HTTP status.
        status: u16,
        /// What the server says.
        said: String,
        /// How long the server says to wait.
        retry_after: Option<Duration>,
    },
    /// Any other refusal.
    #[error("{server} refused {what} (HTTP {status}: {said})")]
    Refused {
        /// The server.
        server: ServerUrl,
        /// What was asked of it.
        what: &'static str,
        /// The HTTP status.
        status: u16,
        /// What the server says.
        said: String,
    },
    /// A response that is not one of the protocol's.
    #[error(
        "{server} answered {what} with something else ({why}): check that the address is a Mon3tr server's, of this program's version"
    )]
    InvalidResponse {
        /// The server.
        server: ServerUrl,
        /// What was asked of it.
        what: &'static str,
        /// What is wrong with the answer.
        why: String,
    },
    /// The presence stream has been silent for longer than a running server is.
    #[error("{server} has sent nothing for {} s: enter the room again", limit.as_secs_f32())]
    PresenceSilent {
        /// The server.
        server: ServerUrl,
        /// How long a silence may be.
        limit: Duration,
    },
    /// The presence stream has ended.
    #[error(
        "{server} has ended this presence: enter the room again, unless another sender has replaced this one"
    )]
    PresenceEnded {
        /// The server.
        server: ServerUrl,
    },
    /// A package arrives compressed, which was not asked for.
    #[error(
        "{server} or a proxy before it compresses packages ({encoding}): switch that off for /v1/packages: packages do not get smaller, and downloads cannot be resumed"
    )]
    CompressedPackage {
        /// The server.
        server: ServerUrl,
        /// The encoding it names.
        encoding: String,
    },
    /// The package has another size than the announcement says.
    #[error(
        "package {package} should have {announced} bytes but the server sends {sent}: the sender must announce it anew"
    )]
    WrongSize {
        /// The package.
        package: PackageId,
        /// Bytes by the announcement.
        announced: u64,
        /// Bytes by the server; without a `Content-Length`, those received until the download was stopped.
        sent: u64,
    },
    /// The package arrived damaged, twice.
    #[error(
        "package {package} arrived damaged twice from {server}: the server's copy is bad or a proxy alters it; upload it again, or use https"
    )]
    Damaged {
        /// The server.
        server: ServerUrl,
        /// The package.
        package: PackageId,
    },
    /// The connection broke too often in a row.
    #[error(
        "gave up on package {package} after {attempts} attempts in a row, at {have} of {total} bytes; these are kept for the next download"
    )]
    GaveUp {
        /// The package.
        package: PackageId,
        /// Attempts since bytes last arrived.
        attempts: u32,
        /// Bytes in the cache.
        have: u64,
        /// Bytes of the whole package.
        total: u64,
        /// What the last attempt ended with.
        #[source]
        last: Box<Self>,
    },
    /// The disk of the package cache is full.
    #[error("the disk that holds {} is full, {needed} more bytes are needed: make room there or choose another cache folder", folder.display())]
    DiskFull {
        /// The cache's folder.
        folder: PathBuf,
        /// Bytes of the package that do not fit.
        needed: u64,
    },
    /// The package cache's folder or a file in it cannot be used.
    #[error("cannot {doing} {}: choose another cache folder or change its permissions", path.display())]
    Cache {
        /// What was tried.
        doing: &'static str,
        /// On what.
        path: PathBuf,
        /// What the system says.
        #[source]
        source: io::Error,
    },
}

impl HttpError {
    /// Whether trying again later cannot help: link, token or address are wrong.
    #[must_use]
    pub fn is_final(&self) -> bool {
        matches!(
            self,
            Self::Unauthorized { .. }
                | Self::NotFound { .. }
                | Self::Untrusted { .. }
                | Self::NoTls { .. }
                | Self::Redirected { .. }
                | Self::InvalidResponse { .. }
                | Self::Protocol(ProtocolError::Address(_) | ProtocolError::Link(_))
        )
    }
}

fn waiting(retry_after: Option<Duration>) -> String {
    retry_after.map_or_else(String::new, |wait| format!(" {} s", wait.as_secs()))
}

/// What `reqwest` says, as ours. Its address is taken off: we name the server.
pub(crate) fn of_request(server: &ServerUrl, error: reqwest::Error) -> HttpError {
    let source = error.without_url();
    let server = server.clone();
    if !source.is_connect() {
        HttpError::ConnectionLost {
            server,
            source: Some(source),
        }
    } else {
        match of_tls(&source) {
            // Whatever came was none of TLS's messages.
            Some(rustls::Error::InvalidMessage(_)) => HttpError::NoTls { server, source },
            Some(_) => HttpError::Untrusted { server, source },
            None => HttpError::Unreachable { server, source },
        }
    }
}

/// What TLS says, if it is about that.
fn of_tls(error: &reqwest::Error) -> Option<&rustls::Error> {
    let mut next: Option<&(dyn Error + 'static)> = Some(error);
    while let Some(error) = next {
        if let Some(error) = error.downcast_ref() {
            return Some(error);
        }
        // An io::Error's `source` skips what it wraps, and here they wrap one another.
        let wrapped = error
            .downcast_ref::<io::Error>()
            .and_then(io::Error::get_ref);
        next = wrapped.map_or_else(|| error.source(), |wrapped| Some(wrapped));
    }
    None
}

/// An error with all its causes, on one line.
pub(crate) fn with_causes(error: &HttpError) -> String {
    let mut text = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let _ = write!(text, ": {cause}");
        next = cause.source();
    }
    text
}
