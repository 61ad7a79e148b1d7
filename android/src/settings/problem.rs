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
        /// Who gave it.
        origin: Origin,
        /// What is wrong with it.
        why: String,
    },
    /// The file has a line that sets nothing.
    #[error("{name} in {origin} is no setting: there are {}", Key::names())]
    Unknown {
        /// Its name, made harmless.
        name: String,
        /// Who gave it.
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
    /// A setting that is needed was given by nobody.
    #[error("{0} is missing")]
    Missing(Key),
    /// A whole room link, and beside it what the link says already.
    #[error(
        "{key} in {origin}: room is a whole link, which says the {key} already; leave one of them away"
    )]
    SaidTwice {
        /// `server` or `token`.
        key: Key,
        /// Who gave it.
        origin: Origin,
    },
    /// A token would be sent to a server that somebody else named.
    #[error(
        "token in {token} is not sent to the server that {server} names: give the token for that server there as well"
    )]
    Crossed {
        /// Who gave the token.
        token: Origin,
        /// Who gave the server.
        server: Origin,
    },
}
