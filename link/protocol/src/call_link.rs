//! The link to a call of several (`docs/protocol.md`, "Calls").

use crate::fragment::Fragment;
use crate::limits::MAX_LINK;
use crate::room_link::{RoomLink, ServerUrl};
use crate::{LinkSecret, Name, ProtocolError, Token};
use identity::KeyHash;
use std::fmt;
use std::str::FromStr;

/// `http(s)://HOST[:PORT][/PREFIX]/calls/CALL#TOKEN[:key=KEY][:secret=SECRET]`: a call, the right to take a seat in it, by which key the one who opened it is known, and
/// what proves to each that the others have the link.
/// It is the same for everyone who joins.
///
/// [`Display`](fmt::Display) gives the whole link, token and all; [`Debug`] hides the token.
#[derive(Clone, PartialEq, Eq)]
pub struct CallLink {
    server: ServerUrl,
    call: Name,
    fragment: Fragment,
}

impl CallLink {
    /// The call of this name on a server, with a member's token for it.
    ///
    /// # Errors
    /// [`ProtocolError::CallLink`] if `call` is no [`Name`] or `token` no [`Token`].
    pub fn of(server: ServerUrl, call: &str, token: &str) -> Result<Self, ProtocolError> {
        let call = name_of_call(call)?;
        let token = Token::new(token).map_err(|error| match error {
            ProtocolError::Token(why) => wrong(&format!("what follows the `#` is no token: {why}")),
            other => other,
        })?;
        Ok(Self {
            server,
            call,
            fragment: Fragment::of(token),
        })
    }

    /// The same link, which also tells the key of the one who opened the call.
    #[must_use]
    pub fn with_key(mut self, key: KeyHash) -> Self {
        self.fragment.key = Some(key);
        self
    }

    /// The same link, which also has a secret that no server learns.
    #[must_use]
    pub fn with_secret(mut self, secret: LinkSecret) -> Self {
        self.fragment.secret = Some(secret);
        self
    }

    /// The key of the one who opened the call, where the link tells it.
    #[must_use]
    pub fn key(&self) -> Option<KeyHash> {
        self.fragment.key
    }

    /// Whether the link has a secret, by which everyone proves that they have it.
    #[must_use]
    pub fn has_secret(&self) -> bool {
        self.fragment.secret.is_some()
    }

    /// The server that has the call.
    #[must_use]
    pub fn server(&self) -> &ServerUrl {
        &self.server
    }

    /// The call's name.
    #[must_use]
    pub fn call(&self) -> &Name {
        &self.call
    }

    /// The member's token.
    #[must_use]
    pub fn token(&self) -> &Token {
        &self.fragment.token
    }

    /// The room that is a seat of the call: with a member's token one may enter it, and join whoever is in it.
    #[must_use]
    pub fn seat(&self, room: &Name) -> RoomLink {
        let fragment = Fragment {
            // Of the one who opened the call alone.
            key: None,
            ..self.fragment.clone()
        };
        RoomLink::of_seat(self.server.clone(), room.clone(), fragment)
    }
}

impl FromStr for CallLink {
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Self, ProtocolError> {
        let text = text.trim();
        if text.len() > MAX_LINK {
            return Err(wrong("it is too long"));
        }
        let (address, fragment) = text
            .split_once('#')
            .ok_or_else(|| wrong("the `#TOKEN` at its end is missing (an unquoted # begins a comment in some shells)"))?;
        let (server, call) = address
            .rsplit_once("/calls/")
            .ok_or_else(|| wrong("it has no `/calls/CALL`"))?;
        let fragment = fragment
            .parse()
            .map_err(|why: String| wrong(&format!("what follows the `#` is wrong: {why}")))?;
        Ok(Self {
            server: server.parse()?,
            call: name_of_call(call)?,
            fragment,
        })
    }
}

impl fmt::Display for CallLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}/calls/{}#{}",
            self.server,
            self.call,
            self.fragment.text()
        )
    }
}

impl fmt::Debug for CallLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/calls/{}#...", self.server, self.call)
    }
}

fn name_of_call(text: &str) -> Result<Name, ProtocolError> {
    let why = "the call's name is missing or has a character that none has";
    text.parse().map_err(|_| wrong(why))
}

fn wrong(why: &str) -> ProtocolError {
    ProtocolError::CallLink(why.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINK: &str = "https://call.example/at/calls/c7#abc";

    #[test]
    fn a_link_comes_back_as_it_was_and_its_seats_are_rooms() {
        let link: CallLink = LINK.parse().expect("a link");
        assert_eq!(link.to_string(), LINK);
        assert_eq!(link.call().as_str(), "c7");
        let seat = link.seat(&"r1".parse().expect("a name"));
        assert_eq!(seat.to_string(), "https://call.example/at/rooms/r1#abc");
        assert_eq!(
            format!("{link:?}"),
            "https://call.example/at/calls/c7#...",
            "a log shows no token"
        );
    }

    #[test]
    fn a_link_tells_the_openers_key_and_its_seats_do_not() {
        let key = "k7qf2mxd3paa4hjwk7qf2mxd3m";
        let text = format!("{LINK}:key={key}");
        let link: CallLink = text.parse().expect("a link");
        assert_eq!(link.key().expect("a key").to_string(), key);
        assert_eq!(link.to_string(), text);
        assert_eq!(link.token().secret(), "abc");
        let seat = link.seat(&"r1".parse().expect("a name"));
        assert_eq!(seat.key(), None, "others sit there, too");
        let newer: CallLink = format!("{LINK}:ask=1").parse().expect("a link");
        assert_eq!(newer.to_string(), LINK, "what is not known is passed over");
    }

    #[test]
    fn what_is_no_link_is_refused_without_its_token() {
        for (text, words) in [
            ("https://call.example/rooms/r7#secret", "/calls/"),
            ("https://call.example/calls/c7", "#TOKEN"),
            ("https://call.example/calls/#secret", "name is missing"),
            ("https://call.example/calls/c/7#secret", "character"),
            ("https://call.example/calls/c7#", "empty"),
            (
                "https://call.example/calls/c7#secret:key=short",
                "key's hash",
            ),
            ("ftp://call.example/calls/c7#secret", "https"),
            ("", "#TOKEN"),
        ] {
            let error = text.parse::<CallLink>().expect_err("no link").to_string();
            assert!(
                error.contains(words) && !error.contains("secret"),
                "{text}: {error}"
            );
        }
        let long = format!("{LINK}{}", "f".repeat(MAX_LINK));
        assert!(long.parse::<CallLink>().is_err(), "too long");
    }
}
