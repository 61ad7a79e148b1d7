//! Guests of a room: each has a link of their own, which says what they are called, until when they may come, and what they may have of the sender. The sender
//! makes the links by itself, keeps no list of them, and knows its own again (`docs/protocol.md`, "Guests").

use crate::{LinkSecret, Name, PersonName};
use data_encoding::BASE64URL_NOPAD;
use std::fmt;
use std::str::FromStr;

/// What a guest may have of the sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rights {
    /// Their motion.
    pub see: bool,
    /// Their voice.
    pub hear: bool,
}

impl Rights {
    /// All there is.
    pub const ALL: Self = Self {
        see: true,
        hear: true,
    };
}

impl fmt::Display for Rights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.see, self.hear) {
            (true, true) => "sh",
            (true, false) => "s",
            (false, true) => "h",
            (false, false) => "-",
        })
    }
}

impl FromStr for Rights {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (see, hear) = match text {
            "sh" => (true, true),
            "s" => (true, false),
            "h" => (false, true),
            _ => return Err("a guest's rights that are none".to_owned()),
        };
        Ok(Self { see, hear })
    }
}

/// What a sender says of a guest. Its text is `NAME.EXPIRES.RIGHTS.TOKEN`, the name in base64url. No two links are of the same guest, since each has a token of
/// its own: whoever is sent away stays away, whatever links are made later.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Guest {
    /// What the sender calls them.
    pub name: PersonName,
    /// Until when they are let in, Unix seconds by the sender's clock.
    pub expires: u64,
    /// What they may have.
    pub rights: Rights,
    /// What the server calls the token of their link.
    pub token: Name,
}

impl fmt::Display for Guest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = BASE64URL_NOPAD.encode(self.name.as_str().as_bytes());
        write!(f, "{name}.{}.{}.{}", self.expires, self.rights, self.token)
    }
}

impl FromStr for Guest {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "a guest's name, time, rights or token is wrong".to_owned();
        // A token's name may have dots.
        let mut parts = text.splitn(4, '.');
        let (Some(name), Some(expires), Some(rights), Some(token)) =
            (parts.next(), parts.next(), parts.next(), parts.next())
        else {
            return Err(wrong());
        };
        let name = BASE64URL_NOPAD.decode(name.as_bytes()).ok();
        let name = name.and_then(|name| String::from_utf8(name).ok());
        // One text for each guest: digits only, and no zero before them.
        let is_number = expires.bytes().all(|b| b.is_ascii_digit()) && !expires.starts_with('0');
        let guest = Self {
            name: name.and_then(|name| name.parse().ok()).ok_or_else(wrong)?,
            expires: (expires.parse().ok())
                .filter(|_| is_number)
                .ok_or_else(wrong)?,
            rights: rights.parse()?,
            token: token.parse().map_err(|_| wrong())?,
        };
        // A name is written in one way only, too.
        (guest.to_string() == text)
            .then_some(guest)
            .ok_or_else(wrong)
    }
}

/// What a guest's link has of them: `GUEST.SECRET`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GuestPass {
    /// Who they are.
    pub guest: Guest,
    /// What proves it.
    pub secret: LinkSecret,
}

impl GuestPass {
    /// Its text, which must not appear in a log.
    pub(crate) fn text(&self) -> String {
        format!("{}.{}", self.guest, self.secret.text())
    }
}

impl FromStr for GuestPass {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (guest, secret) = text.rsplit_once('.').ok_or("a guest's secret is missing")?;
        let secret = LinkSecret::read(secret);
        Ok(Self {
            guest: guest.parse()?,
            secret: secret.ok_or("a guest's secret is too short or too long")?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_guest_is_read_as_written_and_in_no_other_way() {
        let pass = GuestPass {
            guest: Guest {
                name: "Zo\u{eb} \u{1f33b}".parse().expect("a name"),
                expires: 1_900_000_000,
                rights: Rights {
                    see: true,
                    hear: false,
                },
                token: "t-1.a".parse().expect("a name"),
            },
            secret: LinkSecret::new([7; 16]),
        };
        let text = pass.text();
        assert_eq!(
            text, "Wm_DqyDwn4y7.1900000000.s.t-1.a.BwcHBwcHBwcHBwcHBwcHBw",
            "python3: base64.urlsafe_b64encode"
        );
        assert_eq!(text.parse::<GuestPass>(), Ok(pass.clone()));
        assert!(!format!("{pass:?}").contains("Bwc"), "no secret is shown");
        for wrong in [
            "",
            "Wm_DqyDwn4y7.1900000000.s",
            "Wm_DqyDwn4y7.1900000000.s.t.Bwc",
            "Wm_DqyDwn4y7.1900000000.s.BwcHBwcHBwcHBwcHBwcHBw",
            "Wm_DqyDwn4y7.01900000000.s.t.BwcHBwcHBwcHBwcHBwcHBw",
            "Wm_DqyDwn4y7.+1900000000.s.t.BwcHBwcHBwcHBwcHBwcHBw",
            "Wm_DqyDwn4y7.1900000000.-.t.BwcHBwcHBwcHBwcHBwcHBw",
            "Wm_DqyDwn4y7.1900000000.s.t/t.BwcHBwcHBwcHBwcHBwcHBw",
            // A name that steers the terminal, and one with blanks about it.
            "G1sySg.1900000000.s.t.BwcHBwcHBwcHBwcHBwcHBw",
            "IEFkYSA.1900000000.s.t.BwcHBwcHBwcHBwcHBwcHBw",
        ] {
            assert!(wrong.parse::<GuestPass>().is_err(), "{wrong}");
        }
    }
}
