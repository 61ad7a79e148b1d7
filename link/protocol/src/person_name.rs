//! What a person in a call is called.

use crate::ProtocolError;
use crate::limits::MAX_PERSON_NAME;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// A person's name as others read it: 1 to [`MAX_PERSON_NAME`] characters, of which some can be seen and none moves a cursor or turns the direction of writing. It
/// says who they say that they are, nothing more.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct PersonName(String);

impl PersonName {
    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// Whether a character only steers how others are shown: Unicode's bidirectional controls, its zero-width space and its separators of lines.
fn is_steering(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{061c}' | '\u{200b}' | '\u{200e}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// Whether a character leaves no trace by itself: joiners, variation selectors, fillers, soft hyphens, tags, the empty Braille pattern.
fn is_invisible(c: char) -> bool {
    c.is_whitespace()
        || matches!(c, '\u{ad}' | '\u{34f}' | '\u{115f}'..='\u{1160}' | '\u{17b4}'..='\u{17b5}' | '\u{180b}'..='\u{180f}'
            | '\u{200c}'..='\u{200d}' | '\u{2800}' | '\u{3164}' | '\u{fe00}'..='\u{fe0f}' | '\u{ffa0}' | '\u{e0000}'..='\u{e0fff}')
}

impl TryFrom<String> for PersonName {
    type Error = ProtocolError;

    fn try_from(text: String) -> Result<Self, ProtocolError> {
        text.parse()
    }
}

impl FromStr for PersonName {
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Self, ProtocolError> {
        let name = text.trim();
        let is_name = (1..=MAX_PERSON_NAME).contains(&name.chars().count())
            && !name.chars().any(is_steering)
            && !name.chars().all(is_invisible);
        if is_name {
            Ok(Self(name.to_owned()))
        } else {
            Err(ProtocolError::PersonName)
        }
    }
}

impl From<PersonName> for String {
    fn from(name: PersonName) -> Self {
        name.0
    }
}

impl fmt::Display for PersonName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_any_script_are_names_and_what_steers_a_terminal_is_none() {
        for name in ["Ada", "Ибн Сина", "李白", "O'Neill-Žižek", "👩\u{200d}🔬"] {
            assert!(name.parse::<PersonName>().is_ok(), "{name}");
        }
        let long = "x".repeat(MAX_PERSON_NAME + 1);
        for text in [
            "",
            "  ",
            "a\nb",
            "\u{1b}[2J",
            "\u{202e}adA",
            "\u{3164}\u{2800}",
            &long,
        ] {
            assert!(text.parse::<PersonName>().is_err(), "{text:?}");
        }
        let padded: PersonName = "  Ada ".parse().expect("a name");
        assert_eq!(padded.as_str(), "Ada");
    }
}
