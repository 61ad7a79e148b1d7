//! Which way a connection takes through the networks, and why not a better one.

use crate::addresses;
use crate::plan::{Relay, RelayTransport};
use serde::Serialize;
use std::fmt;
use std::net::{IpAddr, SocketAddr};

/// What an address at one end of a path is (RFC 8445, section 4).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CandidateKind {
    /// The machine's own.
    Host,
    /// The one that a NAT gives it, as a STUN server sees it.
    ServerReflexive,
    /// The one that a NAT gives it, as the other side sees it.
    PeerReflexive,
    /// One that a TURN server lends it.
    Relay,
}

/// One end of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct PathEnd {
    /// What its address is.
    pub kind: CandidateKind,
    /// The address.
    pub address: SocketAddr,
}

/// The path that a connection took.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Path {
    /// This side's end.
    pub local: PathEnd,
    /// The other side's end, as this side knows it.
    pub remote: PathEnd,
    /// This machine's own address under [`Self::local`], where that is a NAT's or a relay's.
    #[serde(skip)]
    pub(crate) base: IpAddr,
    /// The relay that this side uses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relay: Option<Relay>,
    /// Whether this side had a relay to use.
    pub relay_offered: bool,
}

impl Path {
    /// A path in words.
    pub(crate) fn told(path: Option<&Self>) -> String {
        path.map_or_else(|| "by a path unknown".to_owned(), ToString::to_string)
    }

    /// Whether this machine no longer has the address at this side's end.
    pub(crate) fn is_cut(&self) -> bool {
        !addresses::has(self.base)
    }

    /// Whether packets pass a TURN server, of either side's.
    #[must_use]
    pub fn is_relayed(&self) -> bool {
        [self.local, self.remote]
            .iter()
            .any(|end| end.kind == CandidateKind::Relay)
    }
}

/// One line: the way, the protocols, and why it is no better one.
impl fmt::Display for Path {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let version = if self.local.address.is_ipv4() { 4 } else { 6 };
        match (&self.relay, self.is_relayed()) {
            (Some(relay), _) => {
                write!(f, "relayed by {relay}, IPv{version}")?;
                f.write_str(match relay.transport {
                    RelayTransport::Udp => {
                        ": a NAT or firewall on one side lets nothing through from the other"
                    }
                    RelayTransport::Tcp => ": this network lets no UDP through to it",
                })
            }
            (None, true) => write!(
                f,
                "relayed by the other side's server, UDP, IPv{version}: a NAT or firewall lets nothing through directly"
            ),
            (None, false) => {
                let own = |end: PathEnd| end.kind == CandidateKind::Host;
                if own(self.local) && own(self.remote) {
                    write!(f, "direct, UDP, IPv{version}")
                } else {
                    write!(f, "direct through NAT, UDP, IPv{version}")
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_says_its_way_and_why_it_is_no_better_one() {
        let end = |kind, address: &str| PathEnd {
            kind,
            address: address.parse().expect("an address"),
        };
        let relay = |transport| Relay {
            host: "call.example".to_owned(),
            port: 3478,
            transport,
        };
        let mut path = Path {
            local: end(CandidateKind::Host, "192.168.1.2:5000"),
            remote: end(CandidateKind::Host, "192.168.1.3:5000"),
            base: [192, 168, 1, 2].into(),
            relay: None,
            relay_offered: true,
        };
        assert_eq!(path.to_string(), "direct, UDP, IPv4");
        path.remote = end(CandidateKind::PeerReflexive, "[2001:db8::1]:5000");
        path.local = end(CandidateKind::Host, "[2001:db8::2]:5000");
        assert_eq!(path.to_string(), "direct through NAT, UDP, IPv6");
        path.remote.kind = CandidateKind::Relay;
        let line = path.to_string();
        assert!(line.starts_with("relayed by the other side's"), "{line}");
        path.local = end(CandidateKind::Relay, "203.0.113.1:50000");
        path.relay = Some(relay(RelayTransport::Udp));
        let line = path.to_string();
        assert!(
            line.starts_with("relayed by call.example over UDP, IPv4: a NAT"),
            "{line}"
        );
        path.relay = Some(relay(RelayTransport::Tcp));
        let line = path.to_string();
        assert!(line.contains("over TCP, IPv4: this network"), "{line}");
        let json = serde_json::to_value(&path).expect("JSON");
        assert_eq!(json["local"]["kind"], "relay", "{json}");
        assert_eq!(json["relay"]["transport"], "tcp", "{json}");
    }
}
