//! The optional member that says whose package it is: a signature of the manifest, which has the hash of every other member.

use super::PackageError;
use super::archive::Archive;
use identity::{Identity, IdentityError, PublicKey, Purpose, Signature};
use std::io::{Read, Seek};

/// Name of the signature's member. Its text is `KEY SIGNATURE`.
pub(super) const SIGNATURE: &str = "signature.txt";

/// Most bytes of it.
const MAX_SIGNATURE: u64 = 256;

/// The member for a package with this manifest.
pub(super) fn pack(signer: &Identity, manifest: &[u8]) -> Vec<u8> {
    let signature = signer.sign(Purpose::Package, manifest);
    format!("{} {signature}\n", signer.public()).into_bytes()
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
    let words = str::from_utf8(text)
        .ok()
        .and_then(|text| text.trim_end().split_once(' '))
        .ok_or(IdentityError::Malformed("a key and its signature"))?;
    let (key, signature): (PublicKey, Signature) = (words.0.parse()?, words.1.parse()?);
    key.verify(Purpose::Package, manifest, &signature)?;
    Ok(key)
}
