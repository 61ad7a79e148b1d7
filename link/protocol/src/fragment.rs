//! What follows a link's `#`, which programs tell no server but for the token.

use crate::guest::GuestPass;
use crate::link_secret::LinkSecret;
use crate::{ProtocolError, Token};
use identity::{IdentityError, KeyHash};
use std::str::FromStr;

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
            text += &format!(":secret={}", secret.text());
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
