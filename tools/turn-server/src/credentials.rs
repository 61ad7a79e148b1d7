//! Credentials limited in time, by the convention "TURN REST" that browsers and other servers know: the user's name is
//! `EXPIRY:SUBJECT`, the password is the Base64 of HMAC-SHA1 of that name by a secret. The server stores none of them.
//!
//! A subject is a room, or `ROOM:ROLE:TOKENS:OWNER` ([`Subject`]): the room, what the bearer is in it, by which token
//! the bearer got the credentials, and whose room it is. Allocations are counted by each of these.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hmac::{Hmac, Mac};
use md5::{Digest, Md5};
use sha1::Sha1;
use std::fmt;

/// The realm of every credential.
pub const REALM: &str = "mon3tr";

/// Characters of a user's name.
const MAX_USERNAME: usize = 256;

/// What the bearer of credentials is in a room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Role {
    /// The one that all others connect to: a part of the room's allocations is kept for it.
    Sender,
    /// One with a single connection.
    #[default]
    Viewer,
    /// One with a connection to each of several others.
    Member,
}

impl Role {
    fn letter(self) -> &'static str {
        match self {
            Self::Sender => "s",
            Self::Viewer => "v",
            Self::Member => "m",
        }
    }
}

/// Whom credentials are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Subject<'a> {
    /// The room.
    pub room: &'a str,
    /// What the bearer is there.
    pub role: Role,
    /// The names of the bearer's token and of those that it was made with, with dots between; the first one is the
    /// bearer's own.
    pub tokens: &'a str,
    /// The room's owner.
    pub owner: &'a str,
}

impl fmt::Display for Subject<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            room,
            role,
            tokens,
            owner,
        } = self;
        write!(f, "{room}:{}:{tokens}:{owner}", role.letter())
    }
}

impl<'a> Subject<'a> {
    /// Nothing for a text of another form. A room alone is a viewer's whose token is not known.
    fn read(text: &'a str) -> Option<Self> {
        let mut parts = text.split(':');
        let room = parts.next()?;
        let Some(role) = parts.next() else {
            return Some(Self {
                room,
                ..Self::default()
            });
        };
        let subject = Self {
            room,
            role: match role {
                "s" => Role::Sender,
                "v" => Role::Viewer,
                "m" => Role::Member,
                _ => return None,
            },
            tokens: parts.next()?,
            owner: parts.next()?,
        };
        parts.next().is_none().then_some(subject)
    }

    /// The name of the bearer's own token.
    pub(crate) fn token(&self) -> &'a str {
        self.tokens.split('.').next().unwrap_or_default()
    }
}

/// The secret that credentials are made from. Whoever has it can make any.
#[derive(Clone)]
pub struct Key([u8; 32]);

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key(..)")
    }
}

/// A name and its password.
#[derive(Clone, PartialEq, Eq)]
pub struct Credentials {
    /// `EXPIRY:SUBJECT`, the expiry in Unix seconds.
    pub username: String,
    /// The password.
    pub password: String,
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Credentials")
            .field("username", &self.username)
            .finish_non_exhaustive()
    }
}

impl Key {
    /// A secret of 32 bytes that is used for nothing else.
    #[must_use]
    pub fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// Credentials for `subject` (a room's name, or a [`Subject`]'s text) that allow new allocations until `expires`
    /// (Unix seconds).
    #[must_use]
    pub fn issue(&self, subject: &str, expires: u64) -> Credentials {
        let username = format!("{expires}:{subject}");
        let password = self.password(&username);
        Credentials { username, password }
    }

    /// The long-term key (RFC 8489, section 9.2.2) of a name, whether it has expired or not; nothing for a name of another form.
    pub(crate) fn long_term(&self, username: &str) -> Option<[u8; 16]> {
        Name::read(username)?;
        Some(long_term_key(username, REALM, &self.password(username)))
    }

    fn password(&self, username: &str) -> String {
        STANDARD.encode(hmac(&self.0, username.as_bytes()).finalize().into_bytes())
    }
}

/// A user's name in its two parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Name<'a> {
    /// Unix seconds.
    pub(crate) expires: u64,
    pub(crate) subject: Subject<'a>,
}

impl<'a> Name<'a> {
    pub(crate) fn read(username: &'a str) -> Option<Self> {
        if username.len() > MAX_USERNAME {
            return None;
        }
        let (expires, subject) = username.split_once(':')?;
        Some(Self {
            expires: expires.parse().ok()?,
            subject: Subject::read(subject)?,
        })
    }
}

/// HMAC-SHA1 of `bytes`, to be finished or compared.
pub(crate) fn hmac(key: &[u8], bytes: &[u8]) -> Hmac<Sha1> {
    // A key of up to the hash's block is filled up with zeros by definition; done here, there is no length to go wrong.
    let mut block = [0; 64];
    let length = key.len().min(block.len());
    block[..length].copy_from_slice(&key[..length]);
    let mut mac = Hmac::<Sha1>::new(&block.into());
    mac.update(bytes);
    mac
}

/// MD5 of user, realm and password, as RFC 8489 has it.
pub(crate) fn long_term_key(username: &str, realm: &str, password: &str) -> [u8; 16] {
    Md5::digest(format!("{username}:{realm}:{password}")).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The password as `printf '1700000000:room' | openssl dgst -sha1 -mac HMAC -macopt hexkey:0707..07 -binary | base64` has it.
    #[test]
    fn a_password_is_what_openssl_makes_of_the_name() {
        let key = Key::new([7; 32]);
        let issued = key.issue("room", 1_700_000_000);
        assert_eq!(issued.username, "1700000000:room");
        assert_eq!(issued.password, "eE/L1SMK+boXoacNtnmBqT6ktuY=");
        assert!(!format!("{issued:?}{key:?}").contains(&issued.password));
    }

    #[test]
    fn a_name_of_another_form_has_no_key() {
        let key = Key::new([7; 32]);
        for name in [
            "",
            "room",
            ":room",
            "-1:room",
            "x:room",
            "1:a:b",
            "1:a:x:b:c",
            "1:a:v:b",
            "1:a:v:b:c:d",
            &format!("1:{}", "a".repeat(300)),
        ] {
            assert_eq!(key.long_term(name), None, "{name}");
        }
        assert!(key.long_term("1:a").is_some(), "a room alone");
    }

    #[test]
    fn a_subject_is_read_as_it_was_written() {
        for role in [Role::Sender, Role::Viewer, Role::Member] {
            let subject = Subject {
                room: "a room",
                role,
                tokens: "own.parent",
                owner: "ada",
            };
            let text = subject.to_string();
            assert_eq!(Subject::read(&text), Some(subject), "{text}");
            assert_eq!(subject.token(), "own");
        }
    }
}
