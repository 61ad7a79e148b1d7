//! Why settings cannot be used. One line each; no line has a token in it.

use super::{Key, Origin};

/// One thing that is wrong with, or missing from, the settings.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// A value cannot be what it is.
    #[error("{key} in {origin}: {why}")]
    Value {
        /// Of which setting.
        key: Key,
        /// Its source.
        origin: Origin,
        /// What is wrong with it.
        why: String,
    },
    /// The file has a line that sets nothing.
    #[error("{name} in {origin} is no setting: there are {}", Key::names())]
    Unknown {
        /// Its name, made harmless.
        name: String,
        /// Its source.
        origin: Origin,
    },
    /// A source cannot be read at all.
    #[error("{origin} cannot be read: {why}")]
    Unreadable {
        /// Which.
        origin: Origin,
        /// Why.
        why: String,
    },
    /// A required setting has no source.
    #[error("{0} is missing")]
    Missing(Key),
    /// A whole room link, and beside it a setting that the link has already.
    #[error(
        "{key} in {origin}: room is a whole link, which says the {key} already; leave one of them away"
    )]
    SaidTwice {
        /// `server` or `token`.
        key: Key,
        /// Its source.
        origin: Origin,
    },
    /// A token would be sent to a server that another source named.
    #[error(
        "token in {token} is not sent to the server that {server} names: give the token for that server there as well"
    )]
    Crossed {
        /// The token's source.
        token: Origin,
        /// The server's source.
        server: Origin,
    },
}
