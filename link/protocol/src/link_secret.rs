//! The secret of those who have a link.

use data_encoding::BASE64URL_NOPAD;
use std::fmt;

/// Bytes of a [`LinkSecret`].
const SECRET_BYTES: usize = 16;

/// What only those have who have a link, a room's or a guest's own: with it sender and viewer prove to each other, past the server, that they do. Its `Debug` hides it.
#[derive(Clone, PartialEq, Eq)]
pub struct LinkSecret([u8; SECRET_BYTES]);

impl LinkSecret {
    /// Of bytes that nobody else knows.
    #[must_use]
    pub fn new(bytes: [u8; SECRET_BYTES]) -> Self {
        Self(bytes)
    }

    /// The key for what is proved with it. It must not appear in a log or a message.
    #[must_use]
    pub fn bytes(&self) -> &[u8; SECRET_BYTES] {
        &self.0
    }

    /// As links have it: 22 characters of base64url. It must not appear in a log.
    pub(crate) fn text(&self) -> String {
        BASE64URL_NOPAD.encode(&self.0)
    }

    pub(crate) fn read(text: &str) -> Option<Self> {
        let bytes = BASE64URL_NOPAD.decode(text.as_bytes()).ok()?;
        bytes.try_into().ok().map(Self)
    }
}

impl fmt::Debug for LinkSecret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("...")
    }
}
