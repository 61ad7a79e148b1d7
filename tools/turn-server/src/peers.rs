//! Where packets may be relayed to: the internet's unicast addresses, not the networks that the server stands in.
//!
//! Without this, whoever has a link to a room could reach through the server what only the server can reach: its loopback, the machines
//! beside it, a cloud's metadata service.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// Which peers a server relays to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reach {
    /// The internet only.
    Public,
    /// Private networks too: those of RFC 1918, RFC 6598 and RFC 4193.
    Private,
}

impl Reach {
    /// Whether a packet may go to `ip`.
    pub(crate) fn allows(self, ip: IpAddr) -> bool {
        // Addresses that stand for an IPv4 address are judged as it.
        match embedded(ip) {
            IpAddr::V4(v4) => self.allows_v4(v4),
            IpAddr::V6(v6) => self.allows_v6(v6),
        }
    }

    fn allows_v4(self, ip: Ipv4Addr) -> bool {
        let [a, b, c, _] = ip.octets();
        let never = a == 0
            || ip.is_loopback()
            || ip.is_link_local()
            || ip.is_multicast()
            // Reserved, and broadcast.
            || a >= 240
            // Protocol assignments (RFC 6890), relays of 6to4, benchmarks.
            || (a, b, c) == (192, 0, 0)
            || (a, b, c) == (192, 88, 99)
            || (a == 198 && b & 0xFE == 18);
        // Shared by a provider's customers (RFC 6598).
        let private = ip.is_private() || (a == 100 && b & 0xC0 == 64);
        !never && (self == Self::Private || !private)
    }

    fn allows_v6(self, ip: Ipv6Addr) -> bool {
        let [first, ..] = ip.segments();
        // Only global unicast addresses (2000::/3) but for tunnels (Teredo, 2001::/32), which lead elsewhere; unique local ones are private.
        let global = first & 0xE000 == 0x2000 && ip.segments()[..2] != [0x2001, 0];
        global || (self == Self::Private && ip.is_unique_local())
    }
}

/// The IPv4 address that an IPv6 address stands for (mapped, compatible, NAT64, 6to4), or the address itself.
fn embedded(ip: IpAddr) -> IpAddr {
    let IpAddr::V6(v6) = ip else { return ip };
    let v4 = |high: u16, low: u16| {
        IpAddr::V4(Ipv4Addr::from_bits(u32::from(high) << 16 | u32::from(low)))
    };
    match v6.segments() {
        [0, 0, 0, 0, 0, 0 | 0xFFFF, high, low] if v6 != Ipv6Addr::LOCALHOST => v4(high, low),
        [0x64, 0xFF9B, 0 | 1, _, _, _, high, low] => v4(high, low),
        [0x2002, high, low, ..] => v4(high, low),
        _ => ip,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowed(reach: Reach, ip: &str) -> bool {
        reach.allows(ip.parse().expect("an address"))
    }

    #[test]
    fn only_the_internet_is_relayed_to() {
        for ip in [
            "0.0.0.0",
            "0.1.2.3",
            "127.0.0.1",
            "127.255.0.1",
            "169.254.169.254",
            "192.0.0.8",
            "198.18.0.1",
            "198.19.255.255",
            "224.0.0.251",
            "240.0.0.1",
            "255.255.255.255",
            "::",
            "::1",
            "fe80::1",
            "ff02::fb",
            "::ffff:127.0.0.1",
            "::127.0.0.1",
            "64:ff9b::7f00:1",
            "64:ff9b:1::a9fe:a9fe",
            "2002:7f00:1::",
            "2001::1",
            "100::1",
        ] {
            assert!(!allowed(Reach::Public, ip), "{ip}");
            assert!(
                !allowed(Reach::Private, ip),
                "{ip}, also where private ones are"
            );
        }
        for ip in [
            "10.0.0.1",
            "172.16.0.1",
            "172.31.255.255",
            "192.168.1.1",
            "100.64.0.1",
            "100.127.0.1",
            "fc00::1",
            "fd12::1",
            "::ffff:10.0.0.1",
            "64:ff9b::c0a8:101",
            "2002:a00:1::",
        ] {
            assert!(!allowed(Reach::Public, ip), "{ip}");
            assert!(allowed(Reach::Private, ip), "{ip}, where private ones are");
        }
        for ip in [
            "1.1.1.1",
            "100.63.0.1",
            "100.128.0.1",
            "172.32.0.1",
            "198.17.0.1",
            "223.255.0.1",
            "2a00::1",
            "2001:4860::8",
            "64:ff9b::101:101",
        ] {
            assert!(allowed(Reach::Public, ip), "{ip}");
        }
    }
}
