//! How this machine can be reached, found out as a call would, without one: who answers, as whom this machine is seen, and whether a relay lends it an address.

use crate::CallError;
use crate::addresses;
use crate::peer::Peer;
use crate::plan::{Planner, Relay, UNREACHABLE, ask_from};
use crate::scope::{Scope, resolve};
use link_protocol::IceServers;
use link_protocol::announcement::ChannelMode;
use link_protocol::ice::{IceKind, IceServer, IceUrl};
use link_protocol::room_link::ServerUrl;
use serde::Serialize;
use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use tokio::net::UdpSocket;
use tokio::time::timeout;

/// What ways there are to this machine.
#[derive(Debug, Clone, Serialize)]
pub struct Reach {
    /// Its own addresses.
    pub own: BTreeSet<IpAddr>,
    /// As whom it is seen, from one socket.
    pub seen: Vec<Sighting>,
    /// STUN servers that did not answer over UDP.
    pub silent: Vec<IceUrl>,
    /// The relay that answers ...
    pub relay: Option<Relay>,
    /// ... and whether it has lent an address.
    pub is_lent: bool,
}

/// What one STUN server saw.
#[derive(Debug, Clone, Serialize)]
pub struct Sighting {
    /// The server.
    pub url: IceUrl,
    /// Its address.
    pub server: IpAddr,
    /// From where this machine's question came.
    pub seen: SocketAddr,
}

/// What is between this machine and the internet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Between {
    /// Nothing: this machine's own address is the one that others see.
    Nothing,
    /// A NAT that gives one address to whomever this machine talks to: others find it by that, where they are behind no stricter one.
    Cone,
    /// A NAT that gives another address for each destination: calls to others who are behind a NAT need a relay.
    Symmetric,
    /// A NAT of one of these two kinds: two STUN servers at different addresses would tell.
    SomeNat,
    /// Something that lets no UDP through, or there is no STUN server to ask.
    NoUdp,
}

impl Reach {
    /// What is between, as far as the answers tell.
    #[must_use]
    pub fn between(&self) -> Between {
        let seen: BTreeSet<SocketAddr> = self.seen.iter().map(|one| one.seen).collect();
        let servers: BTreeSet<IpAddr> = self.seen.iter().map(|one| one.server).collect();
        match self.seen.first() {
            None => Between::NoUdp,
            Some(one) if self.own.contains(&one.seen.ip()) => Between::Nothing,
            Some(_) if seen.len() > 1 => Between::Symmetric,
            // A NAT may tell destinations apart by their address alone.
            Some(_) if servers.len() > 1 => Between::Cone,
            Some(_) => Between::SomeNat,
        }
    }

    /// Asks the servers of a room or call on `server`, and `others`.
    ///
    /// # Errors
    /// If this machine has no network at all.
    pub async fn find(
        server: &ServerUrl,
        servers: &IceServers,
        others: &[IceUrl],
    ) -> Result<Self, CallError> {
        let told = servers.as_slice().iter().flat_map(IceServer::addresses);
        let nearest = Scope::of_server(server).await.unwrap_or(Scope::Internet);
        let told = told.filter(|url| url.kind == IceKind::Stun);
        let mut urls: Vec<_> = told.map(|url| (url, nearest)).collect();
        urls.extend(others.iter().map(|url| (url.clone(), Scope::Machine)));
        let seen = ask_each(&urls).await.unwrap_or_else(|error| {
            log::warn!("no STUN server can be asked: {error}");
            Vec::new()
        });
        let silent = (urls.into_iter().map(|(url, _)| url))
            .filter(|url| !seen.iter().any(|one| one.url == *url))
            .collect();
        // It keeps the way to a relay over TCP.
        let planner = Planner::default();
        let plan = planner.plan(server, servers).await;
        let relay = plan.relay.clone();
        let is_lent = relay.is_some() && {
            let (peer, sdp) = Peer::offer(plan, ChannelMode::Unreliable).await?;
            peer.close().await;
            sdp.lines().any(is_relayed)
        };
        Ok(Self {
            own: addresses::usable(),
            seen,
            silent,
            relay,
            is_lent,
        })
    }
}

/// Whether a line of SDP is the candidate of a relay (RFC 8839, section 5.1).
fn is_relayed(line: &str) -> bool {
    line.starts_with("a=candidate:") && line.contains(" typ relay")
}

/// Asks one after the other, all from one socket, so that what they see can be compared. IPv4 only: no NAT is in the way of IPv6.
async fn ask_each(urls: &[(IceUrl, Scope)]) -> std::io::Result<Vec<Sighting>> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).await?;
    let mut seen = Vec::new();
    for (url, nearest) in urls {
        let found = resolve(&url.host, url.port, *nearest).await;
        let Some(address) = found.into_iter().find(SocketAddr::is_ipv4) else {
            continue;
        };
        if let Ok(Ok(mapped)) = timeout(UNREACHABLE, ask_from(&socket, address)).await {
            seen.push(Sighting {
                url: url.clone(),
                server: address.ip(),
                seen: mapped,
            });
        }
    }
    Ok(seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each with the server's address.
    fn reach(own: &[&str], seen: &[(&str, &str)]) -> Between {
        let seen = seen.iter().map(|(server, seen)| Sighting {
            url: format!("stun:{server}").parse().expect("an address"),
            server: server.parse().expect("an address"),
            seen: seen.parse().expect("an address"),
        });
        Reach {
            own: own
                .iter()
                .map(|own| own.parse().expect("an address"))
                .collect(),
            seen: seen.collect(),
            silent: Vec::new(),
            relay: None,
            is_lent: false,
        }
        .between()
    }

    #[test]
    fn what_is_between_follows_from_what_servers_see() {
        let own = ["192.168.1.2", "203.0.113.5"];
        let (here, there) = ("192.0.2.9", "192.0.2.10");
        assert_eq!(reach(&own, &[(here, "203.0.113.5:9")]), Between::Nothing);
        let own = ["192.168.1.2"];
        assert_eq!(reach(&own, &[]), Between::NoUdp);
        let [one, other] = ["203.0.113.5:9", "203.0.113.5:10"];
        assert_eq!(reach(&own, &[(here, one)]), Between::SomeNat);
        let twice = [(here, one), (here, one)];
        assert_eq!(
            reach(&own, &twice),
            Between::SomeNat,
            "one server, asked twice"
        );
        assert_eq!(reach(&own, &[(here, one), (there, one)]), Between::Cone);
        assert_eq!(
            reach(&own, &[(here, one), (there, other)]),
            Between::Symmetric
        );
    }
}
