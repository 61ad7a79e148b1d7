//! Bearer tokens.

use crate::ProtocolError;
use crate::limits::MAX_TOKEN;
use std::fmt;

/// A bearer token, RFC 6750's `b64token`. It has no `Display` and its `Debug` hides it.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// The token that this text is, without blanks around.
    ///
    /// # Errors
    /// [`ProtocolError::Token`] with the reason.
    pub fn new(text: &str) -> Result<Self, ProtocolError> {
        let text = text.trim();
        if text.is_empty() {
            return Err(ProtocolError::Token("it is empty"));
        }
        if text.len() > MAX_TOKEN {
            return Err(ProtocolError::Token("it is too long"));
        }
        if !text
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || b"-._~+/=".contains(&byte))
        {
            return Err(ProtocolError::Token("it has a character that no token has"));
        }
        Ok(Self(text.to_owned()))
    }

    /// The token's text, for the `Authorization` header. It must not appear in a log or a message.
    #[must_use]
    pub fn secret(&self) -> &str {
        &self.0
    }

    /// `text` with this token replaced, for a server's answer that may repeat it.
    #[must_use]
    pub fn redact(&self, text: &str) -> String {
        text.replace(&self.0, "[token]")
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("...")
    }
}
