//! Servers' addresses, tokens and room links (`docs/protocol.md`, "Tokens and links"). A link is a secret: only [`RoomLink`]'s
//! `Display` prints its token.

use std::{
    fmt,
    net::{IpAddr, UdpSocket},
    str::FromStr,
};

use url::Url;

use crate::limits::{MAX_LINK, MAX_TOKEN};
use crate::{Name, ProtocolError};

/// A server's base address: http or https, a host, maybe a port and a path before `/v1`.
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct ServerUrl {
    /// Without a slash at its end.
    base: String,
}

impl ServerUrl {
    /// Whether the host is this machine's loopback.
    #[must_use]
    pub fn is_loopback(&self) -> bool {
        let Ok(url) = Url::parse(&self.base) else {
            return false;
        };
        match url.host() {
            Some(url::Host::Domain(name)) => name == "localhost",
            Some(url::Host::Ipv4(ip)) => ip.is_loopback(),
            Some(url::Host::Ipv6(ip)) => ip.is_loopback(),
            None => false,
        }
    }

    /// Whether the host is an address of this machine.
    #[must_use]
    pub fn is_here(&self) -> bool {
        let url = Url::parse(&self.base).ok();
        let ip = match url.as_ref().and_then(Url::host) {
            Some(url::Host::Ipv4(ip)) => IpAddr::V4(ip),
            Some(url::Host::Ipv6(ip)) => IpAddr::V6(ip),
            _ => return self.is_loopback(),
        };
        // A machine can bind its own addresses only.
        UdpSocket::bind((ip, 0)).is_ok()
    }
}

impl FromStr for ServerUrl {
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Self, ProtocolError> {
        check_address(text.trim()).map_err(ProtocolError::Address)
    }
}

fn check_address(text: &str) -> Result<ServerUrl, String> {
    if text.len() > MAX_LINK {
        return Err(format!("it is longer than {MAX_LINK} characters"));
    }
    if text.contains(['#', '?']) {
        return Err("it must end before any `#` or `?`".to_owned());
    }
    let url = Url::parse(text).map_err(|error| match error {
        url::ParseError::RelativeUrlWithoutBase => {
            "it must begin with http:// or https://".to_owned()
        }
        other => other.to_string(),
    })?;
    if !matches!(url.scheme(), "http" | "https") {
        return Err(format!(
            "it must begin with http:// or https://, not {}:",
            url.scheme()
        ));
    }
    if !url.has_host() {
        return Err("it names no host".to_owned());
    }
    if !url.username().is_empty() || url.password().is_some() {
        return Err("it must not hold a user name or password".to_owned());
    }
    Ok(ServerUrl {
        base: url.as_str().trim_end_matches('/').to_owned(),
    })
}

impl fmt::Display for ServerUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.base)
    }
}

impl fmt::Debug for ServerUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.base)
    }
}

/// `http(s)://HOST[:PORT][/PREFIX]/rooms/ROOM#TOKEN`: a room, and the right to be in it.
///
/// [`Display`](fmt::Display) gives the whole link, token and all; [`Debug`](fmt::Debug) hides the token.
#[derive(Clone, PartialEq, Eq)]
pub struct RoomLink {
    server: ServerUrl,
    room: Name,
    token: Token,
}

impl RoomLink {
    /// The room of this name on a server, with a token for it.
    ///
    /// # Errors
    /// [`ProtocolError::Link`] if `room` is no [`Name`], [`ProtocolError::Token`] if `token` is no [`Token`].
    pub fn of(server: ServerUrl, room: &str, token: &str) -> Result<Self, ProtocolError> {
        let room = room.parse().map_err(|_| {
            let why = "the room's name is missing or has a character that none has";
            ProtocolError::Link(why.to_owned())
        })?;
        Ok(Self {
            server,
            room,
            token: Token::new(token)?,
        })
    }

    /// The room of this name, with a token that was checked.
    pub(crate) fn with(server: ServerUrl, room: Name, token: Token) -> Self {
        Self {
            server,
            room,
            token,
        }
    }

    /// The server that has the room.
    #[must_use]
    pub fn server(&self) -> &ServerUrl {
        &self.server
    }

    /// The same room at another address of its server, such as a proxy's.
    #[must_use]
    pub fn at(&self, server: ServerUrl) -> Self {
        Self {
            server,
            ..self.clone()
        }
    }

    /// The room's name.
    #[must_use]
    pub fn room(&self) -> &Name {
        &self.room
    }

    /// The token.
    #[must_use]
    pub fn token(&self) -> &Token {
        &self.token
    }
}

impl FromStr for RoomLink {
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Self, ProtocolError> {
        let text = text.trim();
        let wrong = |why: &str| ProtocolError::Link(why.to_owned());
        if text.len() > MAX_LINK {
            return Err(wrong("it is too long"));
        }
        let (address, token) = text
            .split_once('#')
            .ok_or_else(|| wrong("the `#TOKEN` at its end is missing (an unquoted # begins a comment in some shells)"))?;
        let (server, room) = address.rsplit_once("/rooms/").ok_or_else(|| {
            wrong(if address.contains("/calls/") {
                "it is the link of a call of several: `mon3tr call LINK` joins it"
            } else {
                "it has no `/rooms/ROOM`"
            })
        })?;
        let server = check_address(server).map_err(ProtocolError::Link)?;
        Self::of(server, room, token).map_err(|error| match error {
            ProtocolError::Token(why) => {
                ProtocolError::Link(format!("what follows the `#` is no token: {why}"))
            }
            other => other,
        })
    }
}

impl fmt::Display for RoomLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/rooms/{}#{}", self.server, self.room, self.token.0)
    }
}

impl fmt::Debug for RoomLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/rooms/{}#...", self.server, self.room)
    }
}

/// A bearer token, RFC 6750's `b64token`. It has no `Display` and its `Debug` hides it.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// The token that this text is, without blanks around.
    ///
    /// # Errors
    /// [`ProtocolError::Token`] with the reason.
    pub fn new(text: &str) -> Result<Self, ProtocolError> {
        let text = text.trim();
        if text.is_empty() {
            return Err(ProtocolError::Token("it is empty"));
        }
        if text.len() > MAX_TOKEN {
            return Err(ProtocolError::Token("it is too long"));
        }
        if !text
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || b"-._~+/=".contains(&byte))
        {
            return Err(ProtocolError::Token("it has a character that no token has"));
        }
        Ok(Self(text.to_owned()))
    }

    /// The token's text, for the `Authorization` header. It must not appear in a log or a message.
    #[must_use]
    pub fn secret(&self) -> &str {
        &self.0
    }

    /// `text` with this token replaced, for a server's answer that may repeat it.
    #[must_use]
    pub fn redact(&self, text: &str) -> String {
        text.replace(&self.0, "[token]")
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("...")
    }
}
