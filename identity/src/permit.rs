//! That a key's owner lets another key drive their avatars, until some day.

use crate::{Identity, IdentityError, PublicKey, Purpose, Signature};
use std::fmt;
use std::str::FromStr;

/// The owner of a key lets another one drive their avatars. Its text is `OWNER KEY UNTIL SIGNATURE`, with blanks between.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Permit {
    owner: PublicKey,
    key: PublicKey,
    until: u64,
    signature: Signature,
}

impl Permit {
    /// Lets `key` drive what `owner` signed until `until`, seconds since 1970.
    #[must_use]
    pub fn new(owner: &Identity, key: PublicKey, until: u64) -> Self {
        let signature = owner.sign(Purpose::Permit, text(&key, until).as_bytes());
        let owner = owner.public();
        Self {
            owner,
            key,
            until,
            signature,
        }
    }

    /// Whose avatars.
    #[must_use]
    pub fn owner(&self) -> PublicKey {
        self.owner
    }

    /// Who may drive them.
    #[must_use]
    pub fn key(&self) -> PublicKey {
        self.key
    }

    /// Until when, seconds since 1970.
    #[must_use]
    pub fn until(&self) -> u64 {
        self.until
    }

    /// Checks that the owner signed it and that it is not over at `now`, seconds since 1970.
    ///
    /// # Errors
    /// [`IdentityError::WrongSignature`], [`IdentityError::Expired`].
    pub fn check(&self, now: u64) -> Result<(), IdentityError> {
        let text = text(&self.key, self.until);
        self.owner
            .verify(Purpose::Permit, text.as_bytes(), &self.signature)?;
        if now >= self.until {
            return Err(IdentityError::Expired);
        }
        Ok(())
    }
}

/// What is signed.
fn text(key: &PublicKey, until: u64) -> String {
    format!("{key}\n{until}")
}

impl fmt::Display for Permit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            owner,
            key,
            until,
            signature,
        } = self;
        write!(f, "{owner} {key} {until} {signature}")
    }
}

impl FromStr for Permit {
    type Err = IdentityError;

    /// The signature is not checked yet.
    fn from_str(text: &str) -> Result<Self, IdentityError> {
        let wrong = IdentityError::Malformed("a permit: OWNER KEY UNTIL SIGNATURE");
        let words: Vec<&str> = text.split_ascii_whitespace().take(5).collect();
        let [owner, key, until, signature] = words[..] else {
            return Err(wrong);
        };
        Ok(Self {
            owner: owner.parse()?,
            key: key.parse()?,
            until: until.parse().map_err(|_| wrong)?,
            signature: signature.parse()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permit_holds_for_its_key_until_its_day_and_only_as_it_was_signed() {
        let (ada, bob, eve) = (identity(1), identity(2), identity(3));
        let permit = Permit::new(&ada, bob.public(), 1000);
        let read: Permit = permit.to_string().parse().expect("what was written");
        assert_eq!(read, permit);
        assert!(read.check(999).is_ok(), "on the last day");
        assert!(matches!(read.check(1000), Err(IdentityError::Expired)));
        let text = permit.to_string();
        let changed = [
            text.replace(" 1000 ", " 9999 "),
            text.replace(&bob.public().to_string(), &eve.public().to_string()),
            text.replace(&ada.public().to_string(), &eve.public().to_string()),
        ];
        for text in changed {
            let read: Permit = text.parse().expect("a permit by its form");
            let checked = read.check(1);
            assert!(matches!(checked, Err(IdentityError::WrongSignature)));
        }
        for text in ["", "a b c", &format!("{text} more"), "a b c d"] {
            assert!(text.parse::<Permit>().is_err(), "{text}");
        }
    }

    fn identity(seed: u8) -> Identity {
        Identity::from_seed(&[seed; 32]).expect("a key")
    }
}
