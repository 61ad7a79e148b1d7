//! An ICE candidate (RFC 8839, section 5.1).

use std::fmt;
use std::net::IpAddr;

/// Where the other side may be reached.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Candidate {
    pub(crate) foundation: String,
    pub(crate) component: u16,
    pub(crate) is_udp: bool,
    pub(crate) priority: u32,
    pub(crate) host: Host,
    pub(crate) port: u16,
    /// `host`, `srflx`, `prflx` or `relay`; empty for one of another kind.
    pub(crate) kind: &'static str,
}

/// An address of the other side.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Host {
    /// An IP address.
    Ip(IpAddr),
    /// A browser's name for an address of its own network, to be found by multicast DNS.
    Mdns(String),
    /// Any other name.
    Name,
}

impl Host {
    fn of(text: &str) -> Self {
        let is_label = |label: &str| {
            !label.is_empty()
                && label
                    .bytes()
                    .all(|c| c.is_ascii_alphanumeric() || c == b'-')
        };
        match (text.parse(), text.strip_suffix(".local")) {
            (Ok(ip), _) => Self::Ip(ip),
            (Err(_), Some(label)) if is_label(label) && text.len() < 64 => {
                Self::Mdns(text.to_owned())
            }
            _ => Self::Name,
        }
    }
}

impl fmt::Display for Host {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ip(ip) => ip.fmt(f),
            Self::Mdns(name) => name.fmt(f),
            Self::Name => Ok(()),
        }
    }
}

impl Candidate {
    /// The candidate of an attribute with this value.
    pub(super) fn read(value: &str) -> Option<Self> {
        let mut words = value.split(' ');
        let mut next = || words.next().filter(|word| !word.is_empty());
        let foundation = next()
            .filter(|it| super::is_ice_text(it, 1..=32))?
            .to_owned();
        let component = next()?.parse().ok()?;
        let is_udp = next()?.eq_ignore_ascii_case("udp");
        let (priority, host) = (next()?.parse().ok()?, Host::of(next()?));
        let port = next()?.parse().ok()?;
        if next()? != "typ" {
            return None;
        }
        let kind = next()?;
        let known = ["host", "srflx", "prflx", "relay"];
        let kind = known.into_iter().find(|known| *known == kind);
        Some(Self {
            foundation,
            component,
            is_udp,
            priority,
            host,
            port,
            kind: kind.unwrap_or_default(),
        })
    }
}

impl fmt::Display for Candidate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            foundation,
            component,
            priority,
            host,
            port,
            kind,
            ..
        } = self;
        write!(
            f,
            "{foundation} {component} udp {priority} {host} {port} typ {kind}"
        )?;
        // A related address is of no use to this side, but its grammar asks for one.
        match kind {
            &"host" => Ok(()),
            _ => write!(f, " raddr 0.0.0.0 rport 0"),
        }
    }
}
