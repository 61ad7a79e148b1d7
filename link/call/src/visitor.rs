//! A viewer, as far as it has proved who it is.

use identity::PublicKey;
use link_protocol::{Guest, Rights};
use std::fmt;

/// By what a viewer is known again: a guest by what their link says of them, another one by their key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Who {
    /// A guest.
    Guest(Guest),
    /// Whoever has this key.
    Key(PublicKey),
}

/// A viewer, as far as it has proved who it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Visitor {
    /// Its key, where it shows one.
    pub key: Option<PublicKey>,
    /// Whose guest's link it has, if it is one.
    pub guest: Option<Guest>,
}

impl Visitor {
    /// By what it is known again; nothing where it shows nothing.
    #[must_use]
    pub fn who(&self) -> Option<Who> {
        self.identities().next()
    }

    /// All by which it may be known, the best first: a guest has a key, too, as a rule. Whoever is let in is let in by the best of these; whoever is sent
    /// away, by all.
    pub(crate) fn identities(&self) -> impl Iterator<Item = Who> {
        let guest = self.guest.clone().map(Who::Guest);
        guest.into_iter().chain(self.key.map(Who::Key))
    }

    /// What it may have of the sender.
    #[must_use]
    pub fn rights(&self) -> Rights {
        self.guest
            .as_ref()
            .map_or(Rights::ALL, |guest| guest.rights)
    }
}

impl fmt::Display for Visitor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.guest, self.key) {
            (Some(guest), Some(key)) => {
                write!(f, "{} (key {})", guest.name.as_str(), key.fingerprint())
            }
            (Some(guest), None) => write!(f, "{} (no key)", guest.name.as_str()),
            (None, Some(key)) => write!(f, "the key {}", key.fingerprint()),
            (None, None) => f.write_str("a viewer without a key"),
        }
    }
}
