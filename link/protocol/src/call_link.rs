//! The link to a call both ways: the place that is free in it (`docs/protocol.md`, "Tokens and links").

use crate::limits::MAX_LINK;
use crate::room_link::{RoomLink, ServerUrl};
use crate::{Name, ProtocolError};
use std::fmt;
use std::str::FromStr;

/// `http(s)://HOST[:PORT][/PREFIX]/calls/THEIRS/OWN#VIEWER,SENDER`: two rooms, with the viewer's token of the one that the other side is present
/// in, and the sender's of the one that is kept for whoever has the link.
///
/// [`Display`](fmt::Display) gives the whole link, tokens and all; [`Debug`] hides them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CallLink {
    theirs: RoomLink,
    own: RoomLink,
}

impl CallLink {
    /// Of the other side's room, by its viewers' link, and of the one to be present in, by its sender's.
    ///
    /// # Errors
    /// [`ProtocolError::CallLink`] if the rooms are of two servers, or one.
    pub fn of(theirs: RoomLink, own: RoomLink) -> Result<Self, ProtocolError> {
        if theirs.server() != own.server() {
            return Err(wrong("its rooms are of two servers"));
        }
        if theirs.room() == own.room() {
            return Err(wrong("both its rooms are one"));
        }
        Ok(Self { theirs, own })
    }

    /// The other side's room, to be seen and heard, by its viewers' link.
    #[must_use]
    pub fn theirs(&self) -> &RoomLink {
        &self.theirs
    }

    /// The room to be present in, by its sender's link.
    #[must_use]
    pub fn own(&self) -> &RoomLink {
        &self.own
    }
}

impl FromStr for CallLink {
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Self, ProtocolError> {
        let text = text.trim();
        if text.len() > MAX_LINK {
            return Err(wrong("it is too long"));
        }
        let (address, tokens) = text
            .split_once('#')
            .ok_or_else(|| wrong("the `#TOKENS` at its end are missing (an unquoted # begins a comment in some shells)"))?;
        let (server, rooms) = address
            .rsplit_once("/calls/")
            .ok_or_else(|| wrong("it has no `/calls/`"))?;
        let (theirs, own) = rooms
            .split_once('/')
            .ok_or_else(|| wrong("it names one room, not two"))?;
        let (viewer, sender) = tokens
            .split_once(',')
            .ok_or_else(|| wrong("it has one token, not two"))?;
        let server: ServerUrl = server.parse()?;
        Self::of(
            RoomLink::of(server.clone(), theirs, viewer)?,
            RoomLink::of(server, own, sender)?,
        )
    }
}

impl fmt::Display for CallLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [theirs, own]: [&Name; 2] = [self.theirs.room(), self.own.room()];
        let [viewer, sender] = [&self.theirs, &self.own].map(|link| link.token().secret());
        let server = self.own.server();
        write!(f, "{server}/calls/{theirs}/{own}#{viewer},{sender}")
    }
}

fn wrong(why: &str) -> ProtocolError {
    ProtocolError::CallLink(why.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINK: &str = "https://call.example/at/calls/r7/r8#abc,def";

    #[test]
    fn a_link_is_two_rooms_and_comes_back_as_it_was() {
        let link: CallLink = LINK.parse().expect("a link");
        assert_eq!(link.to_string(), LINK);
        assert_eq!(
            link.theirs().to_string(),
            "https://call.example/at/rooms/r7#abc"
        );
        assert_eq!(
            link.own().to_string(),
            "https://call.example/at/rooms/r8#def"
        );
        let shown = format!("{link:?}");
        assert!(!shown.contains("abc") && !shown.contains("def"), "{shown}");
    }

    #[test]
    fn what_is_no_link_is_refused_without_its_tokens() {
        for (text, words) in [
            ("https://call.example/rooms/r7#abc", "/calls/"),
            ("https://call.example/calls/r7/r8", "#TOKENS"),
            ("https://call.example/calls/r7#abc,def", "one room"),
            ("https://call.example/calls/r7/r8#abc", "one token"),
            ("https://call.example/calls/r7/r7#abc,def", "both"),
            ("https://call.example/calls/r7/r8/r9#abc,def", "character"),
            ("ftp://call.example/calls/r7/r8#abc,def", "https"),
            ("", "#TOKENS"),
        ] {
            let error = text.parse::<CallLink>().expect_err("no link").to_string();
            assert!(
                error.contains(words) && !error.contains("def"),
                "{text}: {error}"
            );
        }
        let long = format!("{LINK}{}", "f".repeat(MAX_LINK));
        assert!(long.parse::<CallLink>().is_err(), "too long");
    }
}
