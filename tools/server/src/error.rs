//! Why a server does not start, or stops by itself. An error of one request is answered to its client instead.

use std::net::SocketAddr;
use std::path::PathBuf;

/// A server that cannot start or go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServerError {
    /// The secret's file cannot be read or made.
    #[error("cannot {action} the server's secret in {}", path.display())]
    SecretFile {
        /// "read" or "create".
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The secret's file holds something else.
    #[error(
        "{} does not hold a secret of 64 hexadecimal digits; remove it, and a new one is made (all tokens given out end then)",
        path.display()
    )]
    SecretDamaged {
        /// The file.
        path: PathBuf,
    },
    /// The list of revoked tokens cannot be used.
    #[error(
        "cannot use {}, which lists the tokens that are revoked, a name in each line: mend it, for without it nobody knows which tokens hold",
        path.display()
    )]
    RevokedFile {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The list of revoked tokens has no room for another one.
    #[error(
        "{} lists as many revoked tokens as a server reads, 1 MiB of names: remove those that have expired, the oldest of which come first (a link's token holds for 30 days at most), and try again",
        path.display()
    )]
    RevokedFull {
        /// The file.
        path: PathBuf,
    },
    /// The list of blocked addresses cannot be used.
    #[error(
        "cannot use {}, which lists the addresses that are blocked, an address or a prefix such as 203.0.113.0/24 in each line: correct it",
        path.display()
    )]
    BlockedFile {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {reason}")]
    Random {
        /// What the system said.
        reason: String,
    },
    /// The address cannot be listened on.
    #[error("cannot listen on {address}; choose another address, or port 0 for any free one")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// A folder cannot be used.
    #[error("cannot use {} as {purpose}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What for.
        purpose: &'static str,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// Another server has the folder open.
    #[error(
        "another server uses the folder {}; several instances share an S3-compatible store instead",
        path.display()
    )]
    FolderTaken {
        /// The folder.
        path: PathBuf,
    },
    /// The object store refuses its settings.
    #[cfg(feature = "s3")]
    #[error("cannot open the package store {store}")]
    Store {
        /// Which store.
        store: String,
        /// Why.
        #[source]
        source: object_store::Error,
    },
    /// The certificate or its key cannot be used.
    #[cfg(feature = "tls")]
    #[error("cannot use {} for TLS: {reason}", path.display())]
    Certificate {
        /// The file at fault.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The NATS address or its credentials cannot be used. A server that is merely down is waited for instead.
    #[cfg(feature = "nats")]
    #[error("cannot use the NATS address that was given: {reason}")]
    Nats {
        /// Why, without the address, which may hold a password.
        reason: String,
    },
    /// Calls cannot be relayed.
    #[error(transparent)]
    Turn(#[from] turn_server::TurnError),
    /// The server stopped by itself.
    #[error("the server stopped by itself")]
    Stopped {
        /// Why.
        #[source]
        source: std::io::Error,
    },
}
