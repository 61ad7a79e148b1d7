//! To which addresses a server may have this side send: the STUN and TURN servers that it names are its word alone. A
//! server on the internet must not have its clients look through their own machines and networks.

use link_protocol::room_link::ServerUrl;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;
use tokio::net::lookup_host;
use tokio::time::timeout;

/// How long a name's addresses are waited for.
const LOOKUP: Duration = Duration::from_secs(3);

/// How far packets to an address go, the nearest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Scope {
    /// This machine alone.
    Machine,
    /// A network that the internet does not reach.
    Network,
    /// Anywhere.
    Internet,
}

impl Scope {
    /// That of an address; nothing for one that no single machine has.
    pub(crate) fn of(ip: IpAddr) -> Option<Self> {
        match ip.to_canonical() {
            IpAddr::V4(ip) => Self::of_v4(ip),
            IpAddr::V6(ip) => match ip.segments() {
                // NAT64 (RFC 6052) and 6to4 (RFC 3056) lead to an IPv4 address.
                [0x64, 0xff9b, 0, 0, 0, 0, high, low] | [0x2002, high, low, ..] => {
                    let [[a, b], [c, d]] = [high, low].map(u16::to_be_bytes);
                    Self::of_v4(Ipv4Addr::new(a, b, c, d))
                }
                _ => Self::of_v6(ip),
            },
        }
    }

    fn of_v4(ip: Ipv4Addr) -> Option<Self> {
        let [first, second, ..] = ip.octets();
        // RFC 6598: between a provider and its customers.
        let is_shared = first == 100 && (64..128).contains(&second);
        match first {
            0 | 224.. => None,
            127 => Some(Self::Machine),
            _ if ip.is_private() || ip.is_link_local() || is_shared => Some(Self::Network),
            _ => Some(Self::Internet),
        }
    }

    fn of_v6(ip: Ipv6Addr) -> Option<Self> {
        let is_site_local = ip.segments()[0] & 0xffc0 == 0xfec0;
        if ip.is_unspecified() || ip.is_multicast() {
            None
        } else if ip.is_loopback() {
            Some(Self::Machine)
        } else if ip.is_unique_local() || ip.is_unicast_link_local() || is_site_local {
            Some(Self::Network)
        } else {
            Some(Self::Internet)
        }
    }

    /// That of a server: it may name what is as near as the farthest of its own addresses, or farther. Whoever names a
    /// server chooses its addresses, so one that is near says nothing. Nothing if no address was found.
    pub(crate) async fn of_server(server: &ServerUrl) -> Option<Self> {
        let (host, port) = server.place()?;
        let found = resolve(&host, port, Self::Machine).await;
        let scopes = found.iter().filter_map(|address| Self::of(address.ip()));
        scopes.max()
    }
}

/// The addresses of a host, without those that are nearer than `nearest`.
pub(crate) async fn resolve(host: &str, port: u16, nearest: Scope) -> Vec<SocketAddr> {
    let found = timeout(LOOKUP, lookup_host((host, port))).await;
    let found = found.into_iter().flatten().flatten();
    let is_allowed = |address: &SocketAddr| Scope::of(address.ip()) >= Some(nearest);
    found.filter(is_allowed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_of_this_machine_its_network_or_the_internet() {
        let scope = |text: &str| Scope::of(text.parse().expect("an address"));
        for text in [
            "127.0.0.1",
            "127.9.8.7",
            "::1",
            "::ffff:127.0.0.1",
            "64:ff9b::7f00:1",
            "2002:7f00:1::",
        ] {
            assert_eq!(scope(text), Some(Scope::Machine), "{text}");
        }
        for text in [
            "10.0.0.1",
            "172.16.3.4",
            "192.168.1.1",
            "169.254.169.254",
            "100.64.0.1",
            "fd00::1",
            "fe80::1",
            "fec0::1",
            "::ffff:10.0.0.1",
            "64:ff9b::a00:1",
            "2002:c0a8:101::1",
        ] {
            assert_eq!(scope(text), Some(Scope::Network), "{text}");
        }
        for text in [
            "203.0.113.5",
            "8.8.8.8",
            "100.128.0.1",
            "2001:db8::1",
            "64:ff9b::808:808",
        ] {
            assert_eq!(scope(text), Some(Scope::Internet), "{text}");
        }
        for text in [
            "0.0.0.0",
            "0.1.2.3",
            "224.0.0.251",
            "255.255.255.255",
            "240.0.0.1",
            "::",
            "ff02::fb",
        ] {
            assert_eq!(scope(text), None, "{text}");
        }
    }

    #[tokio::test]
    async fn a_server_names_nothing_nearer_than_itself() {
        let server = |text: &str| text.parse::<ServerUrl>().expect("an address");
        for (text, scope) in [
            ("http://127.0.0.1:8080", Scope::Machine),
            ("http://localhost:8080", Scope::Machine),
            ("https://[::1]", Scope::Machine),
            ("http://192.168.1.7", Scope::Network),
            ("https://203.0.113.5/prefix", Scope::Internet),
        ] {
            let found = Scope::of_server(&server(text)).await;
            assert_eq!(found, Some(scope), "{text}");
        }
        let nowhere = Scope::of_server(&server("http://server.invalid")).await;
        assert_eq!(nowhere, None);
        let found = async |host: &str, nearest| resolve(host, 3478, nearest).await.len();
        for host in [
            "127.0.0.1",
            "localhost",
            "0.0.0.0",
            "10.0.0.1",
            "::1",
            "fe80::1",
        ] {
            assert_eq!(found(host, Scope::Internet).await, 0, "{host}");
        }
        assert_eq!(found("127.0.0.1", Scope::Network).await, 0);
        assert_eq!(found("10.0.0.1", Scope::Network).await, 1);
        assert_eq!(found("127.0.0.1", Scope::Machine).await, 1);
        assert_eq!(found("0.0.0.0", Scope::Machine).await, 0);
    }
}
