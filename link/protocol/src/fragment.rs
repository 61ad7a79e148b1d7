//! What follows a link's `#`, which programs tell no server but for the token.

use crate::guest::GuestPass;
use crate::{ProtocolError, Token};
use data_encoding::BASE64URL_NOPAD;
use identity::{IdentityError, KeyHash};
use std::fmt;
use std::str::FromStr;

/// Bytes of a [`LinkSecret`].
const SECRET_BYTES: usize = 16;

/// `TOKEN[:key=KEY][:secret=SECRET][:guest=GUEST]`. No token has a colon, and a shell leaves it alone.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Fragment {
    pub(crate) token: Token,
    pub(crate) key: Option<KeyHash>,
    pub(crate) secret: Option<LinkSecret>,
    pub(crate) guest: Option<GuestPass>,
}

impl Fragment {
    pub(crate) fn of(token: Token) -> Self {
        Self {
            token,
            key: None,
            secret: None,
            guest: None,
        }
    }

    /// The whole text; it must not appear in a log.
    pub(crate) fn text(&self) -> String {
        let mut text = self.token.secret().to_owned();
        if let Some(key) = self.key {
            text += &format!(":key={key}");
        }
        if let Some(secret) = &self.secret {
            text += &format!(":secret={}", BASE64URL_NOPAD.encode(secret.bytes()));
        }
        if let Some(guest) = &self.guest {
            text += &format!(":guest={}", guest.text());
        }
        text
    }
}

impl FromStr for Fragment {
    type Err = String;

    /// What newer programs may add is passed over.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.split(':');
        let token = Token::new(parts.next().unwrap_or_default());
        let mut fragment = Self::of(token.map_err(|error| match error {
            ProtocolError::Token(why) => format!("the token: {why}"),
            other => other.to_string(),
        })?);
        for part in parts {
            let is_second = match part.split_once('=') {
                Some(("key", key)) => {
                    let key = key
                        .parse()
                        .map_err(|error: IdentityError| error.to_string());
                    fragment.key.replace(key?).is_some()
                }
                Some(("secret", secret)) => {
                    let secret = LinkSecret::read(secret).ok_or("a secret that is too short")?;
                    fragment.secret.replace(secret).is_some()
                }
                Some(("guest", guest)) => fragment.guest.replace(guest.parse()?).is_some(),
                _ => false,
            };
            if is_second {
                return Err("a part of it is there twice".to_owned());
            }
        }
        Ok(fragment)
    }
}

/// What only those have who have a link: with it sender and viewer prove to each other, past the server, that they do. Its `Debug` hides it.
#[derive(Clone, PartialEq, Eq)]
pub struct LinkSecret([u8; SECRET_BYTES]);

impl LinkSecret {
    /// That of a new link, of random bytes.
    #[must_use]
    pub fn new(bytes: [u8; SECRET_BYTES]) -> Self {
        Self(bytes)
    }

    /// The key for what is proved with it. It must not appear in a log or a message.
    #[must_use]
    pub fn bytes(&self) -> &[u8; SECRET_BYTES] {
        &self.0
    }

    fn read(text: &str) -> Option<Self> {
        let bytes = BASE64URL_NOPAD.decode(text.as_bytes()).ok()?;
        bytes.try_into().ok().map(Self)
    }
}

impl fmt::Debug for LinkSecret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("...")
    }
}
