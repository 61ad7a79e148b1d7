//! The names of rooms and sessions.

use crate::ProtocolError;
use crate::limits::MAX_NAME;
use data_encoding::HEXLOWER;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A room's or a session's name: 1 to [`MAX_NAME`] letters, digits and `-._~`, not all of them dots. It stands in paths, and cannot lead
/// out of one.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Name(String);

impl Name {
    /// The name that a server gives to a 128-bit number: 32 lower-case hexadecimal digits.
    #[must_use]
    pub fn of_id(id: [u8; 16]) -> Self {
        Self(HEXLOWER.encode(&id))
    }

    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for Name {
    type Error = ProtocolError;

    fn try_from(text: String) -> Result<Self, ProtocolError> {
        let is_name = (1..=MAX_NAME).contains(&text.len())
            && text
                .bytes()
                .all(|byte| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte))
            && text.bytes().any(|byte| byte != b'.');
        if is_name {
            Ok(Self(text))
        } else {
            Err(ProtocolError::Name)
        }
    }
}

impl FromStr for Name {
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Self, ProtocolError> {
        text.to_owned().try_into()
    }
}

impl From<Name> for String {
    fn from(name: Name) -> Self {
        name.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
