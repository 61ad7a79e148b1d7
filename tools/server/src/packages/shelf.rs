//! Whose a package is in the store: an owner has a shelf of its own, and one more for all that the members of its calls put.
//!
//! Apart, because members are strangers to the owner: they read, announce and remove nothing of the owner's own, and however much they put, the owner's
//! quota is its own.

use super::places::Party;
use crate::Id;
use crate::token::{Claims, Role};

/// A part of the store with a quota.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shelf {
    /// The owner's own. Where it is full the owner is told so, who can remove something.
    Own(Id),
    /// Of the members of this owner's calls. Where it is full the oldest packages make room: nobody of them could remove any.
    Members(Id),
}

impl Shelf {
    /// The one that the bearer of a token puts on, announces from and reads from.
    pub(crate) fn of(claims: &Claims) -> Self {
        match claims.role {
            Role::Owner | Role::Sender | Role::Viewer => Self::Own(claims.owner),
            Role::Member => Self::Members(claims.owner),
        }
    }

    /// Who takes the places of this token's uploads: the owner, or the members of the token's call.
    pub(crate) fn party(claims: &Claims) -> Party {
        Party {
            owner: Self::of(claims).id(),
            call: (claims.role == Role::Member).then(|| claims.room()),
        }
    }

    /// What it is called in the store, as if it were an owner.
    pub(super) fn id(self) -> Id {
        match self {
            Self::Own(owner) => owner,
            Self::Members(owner) => Id::of_members(owner),
        }
    }
}
