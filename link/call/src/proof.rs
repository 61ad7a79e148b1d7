//! Proofs that a side has a link's secret: an HMAC of a text of one connection, by a key made of the secret for one purpose.

use crate::CallError;
use data_encoding::BASE64URL_NOPAD;
use identity::Purpose;
use link_protocol::LinkSecret;
use ring::hmac;

/// The proof about `text`, in base64url. `of` is what the secret is of: `link` or `guest`.
pub(crate) fn prove(secret: &LinkSecret, purpose: Purpose, of: &str, text: &str) -> String {
    let mac = hmac::sign(&key(secret, purpose, of), text.as_bytes());
    BASE64URL_NOPAD.encode(mac.as_ref())
}

/// Checks a proof that the other side has shown, in a time that does not depend on where it differs.
pub(crate) fn check(
    secret: &LinkSecret,
    purpose: Purpose,
    of: &str,
    text: &str,
    shown: &str,
) -> Result<(), CallError> {
    let mac = BASE64URL_NOPAD.decode(shown.as_bytes());
    let mac = mac.map_err(|_| CallError::NoLink)?;
    let is_right = hmac::verify(&key(secret, purpose, of), text.as_bytes(), &mac);
    is_right.map_err(|_| CallError::NoLink)
}

/// The key for one direction: what a viewer sent proves nothing for a sender.
fn key(secret: &LinkSecret, purpose: Purpose, of: &str) -> hmac::Key {
    let secret = hmac::Key::new(hmac::HMAC_SHA256, secret.bytes());
    let key = hmac::sign(&secret, &purpose.text(of.as_bytes()));
    hmac::Key::new(hmac::HMAC_SHA256, key.as_ref())
}
