//! The 128-bit names that this server gives to rooms, sessions and owners.
//!
//! A name from a path is parsed into one of these, or into a `PackageId`, before use: no text of a client's reaches a file name, a
//! subject or a log.

use crate::ServerError;
use data_encoding::HEXLOWER;
use link_protocol::Name;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt;

/// A room, a session or an owner: 128 bits, written as 32 lower-case hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Id([u8; 16]);

impl Id {
    /// A random one, which cannot be guessed.
    ///
    /// # Errors
    /// If the system gives no random numbers.
    pub(crate) fn random() -> Result<Self, ServerError> {
        random_bytes().map(Self)
    }

    /// The owner of this name. Equal names are the same owner on every instance, whatever its secret.
    pub fn of_owner(name: &str) -> Self {
        Self::derived(b"mon3tr owner\0", name.as_bytes())
    }

    /// Under which the store keeps what the members of this owner's calls have put.
    pub(crate) fn of_members(owner: Self) -> Self {
        Self::derived(b"mon3tr members of\0", &owner.0)
    }

    fn derived(purpose: &[u8], from: &[u8]) -> Self {
        let digest = Sha256::new()
            .chain_update(purpose)
            .chain_update(from)
            .finalize();
        let mut bytes = [0; 16];
        bytes.copy_from_slice(&digest[..16]);
        Self(bytes)
    }

    pub(crate) const fn from_bytes(bytes: [u8; 16]) -> Self {
        Self(bytes)
    }

    pub(crate) fn as_bytes(&self) -> &[u8; 16] {
        &self.0
    }

    /// Reads 32 lower-case hexadecimal digits, nothing else.
    pub fn parse(text: &str) -> Option<Self> {
        from_hex(text).map(Self)
    }
}

impl fmt::Display for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        HEXLOWER.encode_display(&self.0).fmt(f)
    }
}

impl fmt::Debug for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl From<Id> for Name {
    fn from(id: Id) -> Self {
        Self::of_id(id.0)
    }
}

impl Serialize for Id {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Id {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = std::borrow::Cow::<'de, str>::deserialize(from)?;
        Self::parse(&text)
            .ok_or_else(|| serde::de::Error::custom("not 32 lower-case hexadecimal digits"))
    }
}

/// Random bytes of the system's.
pub(crate) fn random_bytes<const N: usize>() -> Result<[u8; N], ServerError> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|e| ServerError::Random {
        reason: e.to_string(),
    })?;
    Ok(bytes)
}

/// Reads exactly `2 * N` lower-case hexadecimal digits.
pub(crate) fn from_hex<const N: usize>(text: &str) -> Option<[u8; N]> {
    if text.len() != 2 * N {
        return None;
    }
    let mut bytes = [0; N];
    HEXLOWER.decode_mut(text.as_bytes(), &mut bytes).ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_canonical_spelling_of_an_id_is_read() {
        let id = Id::of_owner("ada");
        assert_eq!(Id::parse(&id.to_string()), Some(id), "its own spelling");
        let upper = id.to_string().to_uppercase();
        for other in ["", "..", "../..", &upper, &format!("{id}0"), "zz"] {
            assert_eq!(Id::parse(other), None, "{other:?}");
        }
    }
}
