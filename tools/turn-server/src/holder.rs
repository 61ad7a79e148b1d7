//! The bearer, room and owner that an allocation is counted for.

use crate::credentials::{Role, Subject};

/// A token's name, and the room that it is used in.
pub(crate) type Token = (String, String);

/// The bearer of credentials.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Holder {
    pub(crate) room: String,
    pub(crate) role: Role,
    /// The names of the token and of those that it was made with.
    pub(crate) tokens: String,
    pub(crate) token: Token,
    /// Nothing where it is not known whose the room is.
    pub(crate) owner: String,
}

impl From<Subject<'_>> for Holder {
    fn from(subject: Subject<'_>) -> Self {
        Self {
            room: subject.room.to_owned(),
            role: subject.role,
            tokens: subject.tokens.to_owned(),
            token: (subject.room.to_owned(), subject.token().to_owned()),
            owner: subject.owner.to_owned(),
        }
    }
}
