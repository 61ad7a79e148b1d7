//! What a person in a call is called.

use crate::ProtocolError;
use crate::limits::MAX_PERSON_NAME;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use unicode_security::skeleton;

/// A person's name as others read it: 1 to [`MAX_PERSON_NAME`] characters that are seen, with single blanks between, and those joiners and variation selectors
/// that scripts and emoji need. It says who they say that they are, nothing more.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct PersonName(String);

impl PersonName {
    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Whether the two look alike: in small or capital letters, by letters of other scripts, or by signs that leave no
    /// trace (UTS #39, section 4).
    #[must_use]
    pub fn looks_like(&self, other: &Self) -> bool {
        let [mine, theirs] = [self.as_seen(), other.as_seen()];
        mine.iter()
            .zip(&theirs)
            .any(|(mine, theirs)| mine == theirs)
    }

    /// The skeletons of the name as it is and of the name in small letters, both in small letters then: a capital I
    /// looks like a small L, and a capital letter means what the small one does.
    #[must_use]
    pub fn as_seen(&self) -> [String; 2] {
        let seen = self.0.chars().filter(|c| *c == ' ' || !is_invisible(*c));
        let seen: String = seen.collect();
        [seen.to_lowercase(), seen].map(|seen| skeleton(&seen).collect::<String>().to_lowercase())
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

/// Whether a character is seen by itself, or does something to its neighbours: a joiner stands between two characters of other scripts than Latin, a variation
/// selector behind one.
fn is_seen_or_needed(letters: &[char], at: usize) -> bool {
    let at_is = |at: Option<usize>, is: &dyn Fn(char) -> bool| {
        at.and_then(|at| letters.get(at)).is_some_and(|c| is(*c))
    };
    let is_selector = |c: char| matches!(c, '\u{180b}'..='\u{180d}' | '\u{fe00}'..='\u{fe0f}');
    let is_foreign = |c: char| !c.is_ascii() && !is_invisible(c);
    let before = at.checked_sub(1);
    match letters.get(at) {
        Some(' ') | None => true,
        Some('\u{200c}' | '\u{200d}') => {
            at_is(before, &|c| is_foreign(c) || is_selector(c)) && at_is(Some(at + 1), &is_foreign)
        }
        Some(c) if is_selector(*c) => at_is(before, &is_foreign),
        Some(c) => !is_invisible(*c),
    }
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
        // No more of it is looked at than may be.
        let begins: Vec<&str> = text.split_whitespace().take(MAX_PERSON_NAME + 1).collect();
        let name = begins.join(" ");
        let letters: Vec<char> = name.chars().take(MAX_PERSON_NAME + 1).collect();
        let is_name = (1..=MAX_PERSON_NAME).contains(&letters.len())
            && !text.trim().chars().any(is_steering)
            && (0..letters.len()).all(|at| is_seen_or_needed(&letters, at));
        if is_name {
            Ok(Self(name))
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
        for name in [
            "Ada",
            "Ибн Сина",
            "李白",
            "O'Neill-Žižek",
            "👩\u{200d}🔬",
            "❤\u{fe0f}\u{200d}🔥",
            "می\u{200c}خواهم",
        ] {
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
            "A\u{200d}da",
            "Ada\u{200d}",
            "A\u{ad}da",
            "Ada\u{fe0f}",
            "Ada\u{e0041}",
            "李\u{3164}白",
            "李\u{200d}\u{200d}白",
            &long,
        ] {
            assert!(text.parse::<PersonName>().is_err(), "{text:?}");
        }
        let padded: PersonName = "  Ada ".parse().expect("a name");
        assert_eq!(padded.as_str(), "Ada");
        let spread: PersonName = "Ada \u{a0}\u{2003} B".parse().expect("a name");
        assert_eq!(spread.as_str(), "Ada B", "one blank, as it is seen");
        let selected: PersonName = "李\u{fe00}白".parse().expect("a name");
        assert!(selected.looks_like(&"李白".parse().expect("a name")));
    }

    #[test]
    fn names_that_look_alike_are_found_and_others_are_not() {
        let name = |text: &str| text.parse::<PersonName>().expect("a name");
        for (one, other) in [
            ("Ada", "ADA"),
            ("Ada", "\u{410}da"),
            ("Ada", "\u{410}d\u{430}"),
            ("ADA", "\u{391}D\u{391}"),
            ("Ada", "\u{ff21}\u{ff44}\u{ff41}"),
            ("Ill", "lll"),
            ("Ill", "ill"),
            ("Oscar", "0scar"),
            ("Emma", "Ernrna"),
            ("Zoë", "Zoe\u{308}"),
            ("Bob 1", "Bob l"),
            ("paypal", "\u{440}\u{430}ypal"),
        ] {
            assert!(name(one).looks_like(&name(other)), "{one} {other}");
            assert!(name(other).looks_like(&name(one)), "{other} {one}");
        }
        for (one, other) in [
            ("Ada", "Adam"),
            ("Ada", "Ida"),
            ("Zoë", "Zoe"),
            ("李白", "李黑"),
        ] {
            assert!(!name(one).looks_like(&name(other)), "{one} {other}");
        }
    }
}
