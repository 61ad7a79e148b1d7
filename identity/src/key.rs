//! A public key, and the forms in which people and links have it.

use crate::{IdentityError, Purpose, Signature};
use data_encoding::{BASE32_NOPAD, BASE64URL_NOPAD};
use sha2::{Digest, Sha256};
use std::fmt;
use std::str::FromStr;

/// Bytes of an Ed25519 public key.
const KEY_BYTES: usize = 32;

/// Bytes of a [`KeyHash`]: whoever looks for another key with the same hash has 2^128 to try.
const HASH_BYTES: usize = 16;

/// Characters of a fingerprint, and of each of its groups: 80 bits, as many as people may be asked to compare.
const FINGERPRINT: usize = 16;
const GROUP: usize = 4;

/// A public key. Its text is 43 characters of base64url.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PublicKey([u8; KEY_BYTES]);

impl PublicKey {
    pub(crate) fn of(bytes: &[u8]) -> Result<Self, IdentityError> {
        let bytes = bytes.try_into();
        bytes
            .map(Self)
            .map_err(|_| IdentityError::Malformed("a public key"))
    }

    /// Its 32 bytes (RFC 8032, section 5.1.5).
    #[must_use]
    pub fn bytes(&self) -> &[u8; KEY_BYTES] {
        &self.0
    }

    /// What a link says of it.
    #[must_use]
    pub fn hash(&self) -> KeyHash {
        let digest = Sha256::digest(self.0);
        KeyHash(std::array::from_fn(|at| digest[at]))
    }

    /// What two people compare, each on their own screen: `k7qf-2mxd-3paa-4hjw`, the first 80 bits of its hash.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        let text = self.hash().to_string();
        let groups: Vec<&str> = (0..FINGERPRINT / GROUP)
            .filter_map(|group| text.get(group * GROUP..(group + 1) * GROUP))
            .collect();
        groups.join("-")
    }

    /// The key in `signed`, `KEY SIGNATURE` as [`crate::Identity::sign_as_text`] has it, which signed `text` for `purpose`.
    ///
    /// # Errors
    /// [`IdentityError::Malformed`], [`IdentityError::WrongSignature`].
    pub fn of_signed(signed: &str, purpose: Purpose, text: &[u8]) -> Result<Self, IdentityError> {
        let words = signed.split_once(' ');
        let (key, signature) = words.ok_or(IdentityError::Malformed("a key and its signature"))?;
        let key: Self = key.parse()?;
        key.verify(purpose, text, &signature.parse()?)?;
        Ok(key)
    }

    /// Checks that this key signed `text` for `purpose`.
    ///
    /// # Errors
    /// [`IdentityError::WrongSignature`].
    pub fn verify(
        &self,
        purpose: Purpose,
        text: &[u8],
        signature: &Signature,
    ) -> Result<(), IdentityError> {
        ring::signature::UnparsedPublicKey::new(&ring::signature::ED25519, &self.0)
            .verify(&purpose.text(text), signature.bytes())
            .map_err(|_| IdentityError::WrongSignature)
    }
}

impl fmt::Display for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&BASE64URL_NOPAD.encode(&self.0))
    }
}

impl fmt::Debug for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.fingerprint())
    }
}

impl serde::Serialize for PublicKey {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl FromStr for PublicKey {
    type Err = IdentityError;

    fn from_str(text: &str) -> Result<Self, IdentityError> {
        let wrong = |_| IdentityError::Malformed("a public key: 43 characters of base64url");
        Self::of(&BASE64URL_NOPAD.decode(text.as_bytes()).map_err(wrong)?)
    }
}

/// The first 128 bits of a public key's SHA-256. Its text is 26 characters of base32, in small letters.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct KeyHash([u8; HASH_BYTES]);

impl fmt::Display for KeyHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&BASE32_NOPAD.encode(&self.0).to_ascii_lowercase())
    }
}

impl fmt::Debug for KeyHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for KeyHash {
    type Err = IdentityError;

    fn from_str(text: &str) -> Result<Self, IdentityError> {
        let wrong = || IdentityError::Malformed("a key's hash: 26 characters of base32");
        let bytes = BASE32_NOPAD.decode(text.to_ascii_uppercase().as_bytes());
        let bytes = bytes.map_err(|_| wrong())?;
        bytes.try_into().map(Self).map_err(|_| wrong())
    }
}
