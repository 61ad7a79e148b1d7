//! The STUN and TURN servers that a room's sender and viewers use to find a way to each other: the server names them, so that nobody
//! configures any.

use crate::ProtocolError;
use crate::limits::{MAX_ICE_SERVERS, MAX_ICE_TEXT, MAX_ICE_URLS};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// The port of STUN and TURN, and the one over TLS, where an address gives none (RFC 7064, RFC 7065).
const PORT: u16 = 3478;
const TLS_PORT: u16 = 5349;

/// Bytes of a name in DNS (RFC 1035, section 2.3.4, without the root's dot).
const MAX_HOST: usize = 253;

/// A server, as WebRTC's `RTCIceServer` has it in JSON. Its [`Debug`] hides the credential.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct IceServer {
    /// Its addresses: each an [`IceUrl`], or one of a later version.
    pub urls: Vec<String>,
    /// The user's name, for TURN.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub username: Option<String>,
    /// The password, for TURN.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub credential: Option<String>,
}

impl IceServer {
    /// Those of its addresses that this version understands.
    pub fn addresses(&self) -> impl Iterator<Item = IceUrl> {
        self.urls.iter().filter_map(|url| url.parse().ok())
    }
}

impl fmt::Debug for IceServer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("IceServer")
            .field("urls", &self.urls)
            .field("username", &self.username)
            .finish_non_exhaustive()
    }
}

/// The servers of a room, within bounds.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<IceServer>")]
pub struct IceServers(Vec<IceServer>);

impl IceServers {
    /// The servers.
    #[must_use]
    pub fn as_slice(&self) -> &[IceServer] {
        &self.0
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl TryFrom<Vec<IceServer>> for IceServers {
    type Error = ProtocolError;

    fn try_from(servers: Vec<IceServer>) -> Result<Self, ProtocolError> {
        let within = |server: &IceServer| {
            let secrets = [&server.username, &server.credential];
            server.urls.len() <= MAX_ICE_URLS
                && server
                    .urls
                    .iter()
                    .chain(secrets.into_iter().flatten())
                    .all(|text| text.len() <= MAX_ICE_TEXT)
        };
        if servers.len() > MAX_ICE_SERVERS || !servers.iter().all(within) {
            return Err(ProtocolError::IceServers);
        }
        Ok(Self(servers))
    }
}

/// What a server is asked for, and over what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum IceKind {
    /// This side's address as others see it, over UDP.
    Stun,
    /// A relay, reached over UDP.
    TurnUdp,
    /// A relay, reached over TCP.
    TurnTcp,
    /// A relay, reached over TLS.
    TurnTls,
}

/// The address of a STUN or TURN server: `stun:HOST[:PORT]`, `turn:HOST[:PORT]?transport=udp` (or `tcp`), `turns:HOST[:PORT]`.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct IceUrl {
    /// What it is for.
    pub kind: IceKind,
    /// A name or an IP address, an IPv6 address without brackets.
    pub host: String,
    /// The port.
    pub port: u16,
}

impl FromStr for IceUrl {
    type Err = ProtocolError;

    fn from_str(text: &str) -> Result<Self, ProtocolError> {
        let wrong = || ProtocolError::IceUrl(text.chars().take(MAX_ICE_TEXT).collect());
        let (scheme, rest) = text.split_once(':').ok_or_else(wrong)?;
        let (address, query) = match rest.split_once('?') {
            Some((address, query)) => (address, Some(query)),
            None => (rest, None),
        };
        let kind = match (scheme, query) {
            // RFC 7064 has no query, but some write one.
            ("stun", None | Some("transport=udp")) => IceKind::Stun,
            ("turn", None | Some("transport=udp")) => IceKind::TurnUdp,
            ("turn", Some("transport=tcp")) => IceKind::TurnTcp,
            ("turns", None | Some("transport=tcp")) => IceKind::TurnTls,
            _ => return Err(wrong()),
        };
        let (host, port) = match address.rsplit_once(':') {
            // A colon within brackets is an IPv6 address's.
            Some((host, port)) if !port.ends_with(']') => {
                (host, port.parse().map_err(|_| wrong())?)
            }
            _ if kind == IceKind::TurnTls => (address, TLS_PORT),
            _ => (address, PORT),
        };
        let host = url::Host::parse(host).map_err(|_| wrong())?.to_string();
        // The longest name that DNS has: whatever is accepted can also be written within MAX_ICE_TEXT.
        if text.len() > MAX_ICE_TEXT || host.len() > MAX_HOST || port == 0 {
            return Err(wrong());
        }
        Ok(Self {
            kind,
            host: host.trim_matches(['[', ']']).to_owned(),
            port,
        })
    }
}

impl fmt::Display for IceUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (scheme, query) = match self.kind {
            IceKind::Stun => ("stun", ""),
            IceKind::TurnUdp => ("turn", "?transport=udp"),
            IceKind::TurnTcp => ("turn", "?transport=tcp"),
            IceKind::TurnTls => ("turns", "?transport=tcp"),
        };
        let port = self.port;
        if self.host.contains(':') {
            write!(f, "{scheme}:[{}]:{port}{query}", self.host)
        } else {
            write!(f, "{scheme}:{}:{port}{query}", self.host)
        }
    }
}

impl Serialize for IceUrl {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_as_rfc_7064_and_7065_have_them() {
        for (text, kind, host, port) in [
            ("stun:example.org", IceKind::Stun, "example.org", 3478),
            ("stun:192.0.2.1:19302", IceKind::Stun, "192.0.2.1", 19302),
            ("turn:example.org", IceKind::TurnUdp, "example.org", 3478),
            (
                "turn:[2001:db8::1]:80?transport=udp",
                IceKind::TurnUdp,
                "2001:db8::1",
                80,
            ),
            (
                "turn:a.example:443?transport=tcp",
                IceKind::TurnTcp,
                "a.example",
                443,
            ),
            ("turns:a.example", IceKind::TurnTls, "a.example", 5349),
        ] {
            let url: IceUrl = text.parse().expect(text);
            let host = host.to_owned();
            assert_eq!(url, IceUrl { kind, host, port }, "{text}");
            let again: IceUrl = url.to_string().parse().expect("as it was written");
            assert_eq!(again, url, "{url}");
        }
        let longest = format!("turns:{}", "a".repeat(MAX_HOST));
        let url: IceUrl = longest.parse().expect("the longest name");
        let again: IceUrl = url.to_string().parse().expect("written, it is longer");
        assert_eq!(again, url);
        let longer = format!("turns:{}", "a".repeat(MAX_ICE_TEXT - 10));
        let long = format!("stun:{}", "a".repeat(MAX_ICE_TEXT));
        for text in [
            &longer,
            "",
            "stun",
            "stun:",
            "stun:a:0",
            "stun:a:70000",
            "stun:a/b",
            "stun:user@a",
            "stun:a?transport=tcp",
            "turn:a?transport=sctp",
            "http://a",
            "stun://a",
            &long,
        ] {
            assert!(text.parse::<IceUrl>().is_err(), "{text}");
        }
    }

    #[test]
    fn servers_are_written_as_browsers_read_them_and_bounded_when_read() {
        let written = r#"[{"urls":["turn:a.example:3478?transport=udp","later:x"],"username":"1:r","credential":"secret"},{"urls":["stun:a.example"]}]"#;
        let servers: IceServers = serde_json::from_str(written).expect("servers");
        assert_eq!(
            serde_json::to_string(&servers).expect("written"),
            written,
            "the same again"
        );
        let first = servers.as_slice().first().expect("two");
        assert_eq!(
            first.addresses().count(),
            1,
            "a later version's is left out"
        );
        assert!(!format!("{servers:?}").contains("secret"), "not in a log");
        let many = |count| {
            let server = r#"{"urls":[]}"#;
            format!("[{}]", vec![server; count].join(","))
        };
        let url = |length| format!(r#"[{{"urls":["{}"]}}]"#, "x".repeat(length));
        let urls = |count| format!(r#"[{{"urls":[{}]}}]"#, vec!["\"x\""; count].join(","));
        for (good, bad) in [
            (many(MAX_ICE_SERVERS), many(MAX_ICE_SERVERS + 1)),
            (url(MAX_ICE_TEXT), url(MAX_ICE_TEXT + 1)),
            (urls(MAX_ICE_URLS), urls(MAX_ICE_URLS + 1)),
        ] {
            assert!(serde_json::from_str::<IceServers>(&good).is_ok(), "{good}");
            assert!(serde_json::from_str::<IceServers>(&bad).is_err(), "{bad}");
        }
    }
}
