//! The link to a call of several (`docs/protocol.md`, "Calls").

use crate::limits::MAX_LINK;
use crate::room_link::{RoomLink, ServerUrl, Token};
use crate::{Name, ProtocolError};
use std::fmt;
use std::str::FromStr;

/// `http(s)://HOST[:PORT][/PREFIX]/calls/CALL#TOKEN`: a call, and the right to take a seat in it. It is the same for everyone who joins.
///
/// [`Display`](fmt::Display) gives the whole link, token and all; [`Debug`] hides the token.
#[derive(Clone, PartialEq, Eq)]
pub struct CallLink {
    server: ServerUrl,
    call: Name,
    token: Token,
}

impl CallLink {
    /// The call of this name on a server, with a member's token for it.
    ///
    /// # Errors
    /// [`ProtocolError::CallLink`] if `call` is no [`Name`] or `token` no [`Token`].
    pub fn of(server: ServerUrl, call: &str, token: &str) -> Result<Self, ProtocolError> {
        let call = call
            .parse()
            .map_err(|_| wrong("the call's name is missing or has a character that none has"))?;
        let token = Token::new(token).map_err(|error| match error {
            ProtocolError::Token(why) => wrong(&format!("what follows the `#` is no token: {why}")),
            other => other,
        })?;
        Ok(Self {
            server,
            call,
            token,
        })
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
        &self.token
    }

    /// The room that is a seat of the call: with a member's token one may enter it, and join whoever is in it.
    #[must_use]
    pub fn seat(&self, room: &Name) -> RoomLink {
        RoomLink::with(self.server.clone(), room.clone(), self.token.clone())
    }
}

impl FromStr for CallLink {
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Self, ProtocolError> {
        let text = text.trim();
        if text.len() > MAX_LINK {
            return Err(wrong("it is too long"));
        }
        let (address, token) = text
            .split_once('#')
            .ok_or_else(|| wrong("the `#TOKEN` at its end is missing (an unquoted # begins a comment in some shells)"))?;
        let (server, call) = address
            .rsplit_once("/calls/")
            .ok_or_else(|| wrong("it has no `/calls/CALL`"))?;
        Self::of(server.parse()?, call, token)
    }
}

impl fmt::Display for CallLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}/calls/{}#{}",
            self.server,
            self.call,
            self.token.secret()
        )
    }
}

impl fmt::Debug for CallLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/calls/{}#...", self.server, self.call)
    }
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
    fn what_is_no_link_is_refused_without_its_token() {
        for (text, words) in [
            ("https://call.example/rooms/r7#secret", "/calls/"),
            ("https://call.example/calls/c7", "#TOKEN"),
            ("https://call.example/calls/#secret", "name is missing"),
            ("https://call.example/calls/c/7#secret", "character"),
            ("https://call.example/calls/c7#", "empty"),
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
