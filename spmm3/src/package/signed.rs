//! The optional member that says whose package it is: a signature of the manifest, which has the hash of every other member.

use super::PackageError;
use super::archive::Archive;
use identity::{Identity, IdentityError, PublicKey, Purpose};
use std::io::{Read, Seek};

/// Name of the signature's member. Its text is `KEY SIGNATURE`.
pub(super) const SIGNATURE: &str = "signature.txt";

/// Most bytes of it.
const MAX_SIGNATURE: u64 = 256;

/// The member for a package with this manifest.
pub(super) fn pack(signer: &Identity, manifest: &[u8]) -> Vec<u8> {
    let signed = signer.sign_as_text(Purpose::Package, manifest);
    format!("{signed}\n").into_bytes()
}

/// Who signed the manifest, if anyone did.
pub(super) fn signer<R: Read + Seek>(
    archive: &mut Archive<R>,
    manifest: &[u8],
) -> Result<Option<PublicKey>, PackageError> {
    if !archive.names().iter().any(|name| name == SIGNATURE) {
        return Ok(None);
    }
    let text = archive.unpack(SIGNATURE, MAX_SIGNATURE)?;
    let key = checked(&text, manifest);
    key.map(Some)
        .map_err(|error| PackageError::member(SIGNATURE, error.to_string()))
}

fn checked(text: &[u8], manifest: &[u8]) -> Result<PublicKey, IdentityError> {
    let text = str::from_utf8(text).map_err(|_| IdentityError::Malformed("a text"))?;
    PublicKey::of_signed(text.trim_end(), Purpose::Package, manifest)
}
