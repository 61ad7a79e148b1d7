//! Servers' addresses, tokens and room links (`docs/protocol.md`, "Tokens and links"). A link is a secret: only [`RoomLink`]'s
//! `Display` prints its token.

use std::{
    fmt,
    net::{IpAddr, UdpSocket},
    str::FromStr,
};

use url::Url;

use identity::KeyHash;

use crate::fragment::Fragment;
use crate::guest::GuestPass;
use crate::limits::{MAX_ADDRESS, MAX_LINK};
use crate::{LinkSecret, Name, ProtocolError, Token};

/// A server's base address: http or https, a host, maybe a port and a path before `/v1`.
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct ServerUrl {
    /// Without a slash at its end.
    base: String,
}

impl ServerUrl {
    /// The host and, where the address has one, the port: `HOST[:PORT]`. Letters of other scripts than Latin are in it
    /// as `xn--` and ASCII.
    #[must_use]
    pub fn authority(&self) -> &str {
        let (_, rest) = self.base.split_once("://").unwrap_or_default();
        rest.split_once('/')
            .map_or(rest, |(authority, _)| authority)
    }

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

    /// Its host's name or address, an IPv6 address without brackets, and its port.
    #[must_use]
    pub fn place(&self) -> Option<(String, u16)> {
        let url = Url::parse(&self.base).ok()?;
        let host = url.host_str()?.trim_matches(['[', ']']).to_owned();
        Some((host, url.port_or_known_default()?))
    }

    /// Whether it is reached by plain HTTP, from another machine.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.base.starts_with("http://") && !self.is_loopback()
    }

    /// Whether what is said to it can be read and changed on its way across the internet: plain HTTP to a host that is neither this machine nor in a private
    /// network. A name counts as one of the internet unless it ends in `.local` or has no dot.
    #[must_use]
    pub fn is_unprotected(&self) -> bool {
        let Some(url) = Url::parse(&self.base)
            .ok()
            .filter(|url| url.scheme() == "http")
        else {
            return false;
        };
        match url.host() {
            Some(url::Host::Domain(name)) => name.contains('.') && !name.ends_with(".local"),
            Some(url::Host::Ipv4(ip)) => {
                !(ip.is_loopback() || ip.is_private() || ip.is_link_local())
            }
            Some(url::Host::Ipv6(ip)) => {
                !(ip.is_loopback() || ip.is_unique_local() || ip.is_unicast_link_local())
            }
            None => true,
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
    let too_long = || format!("it is longer than {MAX_ADDRESS} characters");
    // Before it is parsed, which takes long for a long one, and again as it is written, which may be several times as long.
    if text.len() > MAX_ADDRESS {
        return Err(too_long());
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
        // Not repeated: it may be the first part of a token.
        return Err("it must begin with http:// or https://".to_owned());
    }
    if !url.has_host() {
        return Err("it names no host".to_owned());
    }
    if !url.username().is_empty() || url.password().is_some() {
        return Err("it must not hold a user name or password".to_owned());
    }
    let base = url.as_str().trim_end_matches('/');
    if base.len() > MAX_ADDRESS {
        return Err(too_long());
    }
    Ok(ServerUrl {
        base: base.to_owned(),
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

/// `http(s)://HOST[:PORT][/PREFIX]/rooms/ROOM#TOKEN[:key=KEY][:secret=SECRET][:guest=GUEST]`: a room, the right to be in it, by which key its sender is known, and what
/// proves to sender and viewers that the other side has the link; and for a guest, who they are.
///
/// [`Display`](fmt::Display) gives the whole link, token and all; [`Debug`](fmt::Debug) hides the token.
#[derive(Clone, PartialEq, Eq)]
pub struct RoomLink {
    server: ServerUrl,
    room: Name,
    fragment: Fragment,
    is_seat: bool,
}

impl RoomLink {
    /// The room of this name on a server, with a token for it.
    ///
    /// # Errors
    /// [`ProtocolError::Link`] if `room` is no [`Name`], [`ProtocolError::Token`] if `token` is no [`Token`].
    pub fn of(server: ServerUrl, room: &str, token: &str) -> Result<Self, ProtocolError> {
        Ok(Self {
            server,
            room: name_of_room(room)?,
            fragment: Fragment::of(Token::new(token)?),
            is_seat: false,
        })
    }

    /// The seat of this name, of a call with that link.
    pub(crate) fn of_seat(server: ServerUrl, room: Name, fragment: Fragment) -> Self {
        Self {
            server,
            room,
            fragment,
            is_seat: true,
        }
    }

    /// Whether it is a seat of a call: whoever sits there is met directly, and by nobody but the others of the call.
    #[must_use]
    pub fn is_seat(&self) -> bool {
        self.is_seat
    }

    /// The same link, which also tells the sender's key.
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

    /// The same room by a guest's own link: another token, and who the guest is.
    #[must_use]
    pub fn for_guest(mut self, token: Token, pass: GuestPass) -> Self {
        self.fragment.token = token;
        self.fragment.guest = Some(pass);
        self
    }

    /// Who the bearer is, where it is a guest's own link.
    #[must_use]
    pub fn guest(&self) -> Option<&GuestPass> {
        self.fragment.guest.as_ref()
    }

    /// The secret of those who have the link, if it has one.
    #[must_use]
    pub fn secret(&self) -> Option<&LinkSecret> {
        self.fragment.secret.as_ref()
    }

    /// The sender's key, where the link tells it. Who joins by such a link takes no other sender.
    #[must_use]
    pub fn key(&self) -> Option<KeyHash> {
        self.fragment.key
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
        &self.fragment.token
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
        let (address, fragment) = text
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
        let fragment = fragment
            .parse()
            .map_err(|why| ProtocolError::Link(format!("what follows the `#` is wrong: {why}")))?;
        Ok(Self {
            server,
            room: name_of_room(room)?,
            fragment,
            is_seat: false,
        })
    }
}

fn name_of_room(text: &str) -> Result<Name, ProtocolError> {
    text.parse().map_err(|_| {
        let why = "the room's name is missing or has a character that none has";
        ProtocolError::Link(why.to_owned())
    })
}

impl fmt::Display for RoomLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}/rooms/{}#{}",
            self.server,
            self.room,
            self.fragment.text()
        )
    }
}

impl fmt::Debug for RoomLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/rooms/{}#...", self.server, self.room)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_authority_is_host_and_port_in_ascii() {
        for (address, authority) in [
            ("https://example.com/a/b/", "example.com"),
            ("http://192.0.2.1:8080", "192.0.2.1:8080"),
            ("http://[2001:db8::1]:8080/x:y", "[2001:db8::1]:8080"),
            ("https://ex\u{430}mple.com", "xn--exmple-4nf.com"),
        ] {
            let server: ServerUrl = address.parse().expect("an address");
            assert_eq!(server.authority(), authority);
        }
    }

    #[test]
    fn an_address_is_as_long_as_it_is_written() {
        // Each letter of this path is written as six characters.
        for (letters, is_read) in [(300, true), (400, false)] {
            let address = format!("https://h/{}", "д".repeat(letters));
            assert!(address.len() < MAX_ADDRESS, "{letters} are short");
            match address.parse::<ServerUrl>() {
                Ok(read) => {
                    assert!(is_read, "{letters} letters");
                    let again = read.to_string().parse::<ServerUrl>();
                    assert!(again.is_ok_and(|again| again == read), "{letters} letters");
                }
                Err(why) => {
                    assert!(!is_read, "{letters} letters: {why}");
                    assert!(why.to_string().contains("2048 characters"), "{why}");
                }
            }
        }
    }
}
