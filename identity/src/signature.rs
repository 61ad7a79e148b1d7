//! Signatures, and what they are for.

use crate::IdentityError;
use data_encoding::BASE64URL_NOPAD;
use std::fmt;
use std::str::FromStr;

/// Bytes of an Ed25519 signature.
const BYTES: usize = 64;

/// What a signature is for. What is signed begins with its name on a line of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// An avatar's package: the manifest, which has the hash of every member.
    Package,
    /// A sender's connection to one viewer.
    Sender,
    /// A viewer's connection.
    Viewer,
    /// Another key may drive one's avatars.
    Permit,
    /// What a sender sends sealed, for a forwarder to hand on.
    Seal,
    /// What a guest's secret is made of; such a signature is shown to nobody.
    Guest,
    /// What a sender is called, on a connection to one viewer.
    Name,
    /// A sender's half of the agreement on the keys of what a forwarder hands on, for one viewer.
    Exchange,
    /// A member's key, which the other members of a call are shown.
    Member,
}

impl Purpose {
    /// What is signed for `text`.
    #[must_use]
    pub fn text(self, text: &[u8]) -> Vec<u8> {
        let name: &[u8] = match self {
            Self::Package => b"mon3tr package 1\n",
            Self::Sender => b"mon3tr sender 1\n",
            Self::Viewer => b"mon3tr viewer 1\n",
            Self::Permit => b"mon3tr permit 1\n",
            Self::Seal => b"mon3tr seal 1\n",
            Self::Guest => b"mon3tr guest 1\n",
            Self::Name => b"mon3tr name 1\n",
            Self::Exchange => b"mon3tr exchange 1\n",
            Self::Member => b"mon3tr member 1\n",
        };
        [name, text].concat()
    }
}

/// A signature. Its text is 86 characters of base64url.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Signature([u8; BYTES]);

impl Signature {
    pub(crate) fn of_array(bytes: [u8; BYTES]) -> Self {
        Self(bytes)
    }

    pub(crate) fn of(bytes: &[u8]) -> Result<Self, IdentityError> {
        let bytes = bytes.try_into();
        bytes
            .map(Self)
            .map_err(|_| IdentityError::Malformed("a signature"))
    }

    /// Its 64 bytes (RFC 8032, section 5.1.6).
    #[must_use]
    pub fn bytes(&self) -> &[u8; BYTES] {
        &self.0
    }
}

impl fmt::Display for Signature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&BASE64URL_NOPAD.encode(&self.0))
    }
}

impl fmt::Debug for Signature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a signature")
    }
}

impl FromStr for Signature {
    type Err = IdentityError;

    fn from_str(text: &str) -> Result<Self, IdentityError> {
        let wrong = |_| IdentityError::Malformed("a signature: 86 characters of base64url");
        Self::of(&BASE64URL_NOPAD.decode(text.as_bytes()).map_err(wrong)?)
    }
}
