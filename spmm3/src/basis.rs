//! Which numbers a face's 50 expression slots take: the name of their basis.

use crate::PersonError;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;

/// Most bytes of a basis' name.
const MAX_NAME: usize = 64;

/// The basis of expression coefficients, by its name. Coefficients mean something in their own basis only: two equal names are
/// the same basis, whatever program wrote them.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct ExpressionBasis(Cow<'static, str>);

impl ExpressionBasis {
    /// MakeHuman's expression units compressed to 16 orthogonal ones, as `mon3tr bake` makes them of the raw material of 2020.
    pub const MAKEHUMAN_1: Self = Self(Cow::Borrowed("mon3tr-makehuman-1"));
    /// The first 50 expression components of FLAME 2020, which SMPL-X has as well.
    pub const FLAME_2020: Self = Self(Cow::Borrowed("flame-2020"));
    /// The strengths (0..=1) of ARKit's 52 blend shapes in the alphabetical order of their names, `browDownLeft` first; the last
    /// two, `noseSneerRight` and `tongueOut`, have no slot.
    pub const ARKIT_52: Self = Self(Cow::Borrowed("arkit-52"));

    /// A basis by its name.
    ///
    /// # Errors
    /// If the name is empty, longer than 64 bytes or anything but letters, digits, `-`, `_` and `.` of ASCII: it is printed.
    pub fn new(name: impl Into<Cow<'static, str>>) -> Result<Self, PersonError> {
        let name = name.into();
        let plain = |b: u8| b.is_ascii_alphanumeric() || b"-_.".contains(&b);
        if name.is_empty() || name.len() > MAX_NAME || !name.bytes().all(plain) {
            return Err(PersonError::BasisName);
        }
        Ok(Self(name))
    }

    /// Its name, e.g. `flame-2020`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for ExpressionBasis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl TryFrom<String> for ExpressionBasis {
    type Error = PersonError;

    fn try_from(name: String) -> Result<Self, PersonError> {
        Self::new(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_could_not_be_printed_in_one_line_is_refused() {
        for name in ["", "a b", "a\nb", "\u{202e}x", &"x".repeat(65)] {
            assert!(ExpressionBasis::new(name.to_owned()).is_err(), "{name:?}");
        }
        let known = ExpressionBasis::new("flame-2020").expect("a good name");
        assert_eq!(known, ExpressionBasis::FLAME_2020, "by name alone");
    }

    #[test]
    fn it_is_written_as_its_name_and_checked_when_read() {
        let text = serde_json::to_string(&ExpressionBasis::ARKIT_52).expect("text");
        assert_eq!(text, "\"arkit-52\"", "its name");
        let back: ExpressionBasis = serde_json::from_str(&text).expect("read");
        assert_eq!(back, ExpressionBasis::ARKIT_52, "and back");
        assert!(
            serde_json::from_str::<ExpressionBasis>("\"a b\"").is_err(),
            "checked"
        );
    }
}
