//! This machine's addresses: those that a connection binds, and whether they have changed.

use link_protocol::room_link::ServerUrl;
use rtc::shared::ifaces::ifaces;
use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;
use tokio::time::{Interval, MissedTickBehavior, interval};

/// How often changes are looked for: a call should go on within two seconds.
const LOOK: Duration = Duration::from_millis(250);

/// Addresses that are bound at most, of each family: each costs a socket, and pairs with each of the other side's.
const MOST: usize = 8;

/// The addresses by which other machines may reach this one.
pub(crate) fn usable() -> BTreeSet<IpAddr> {
    let interfaces = ifaces().unwrap_or_else(|error| {
        log::debug!("the network's interfaces cannot be listed: {error}");
        Vec::new()
    });
    let addresses = interfaces.into_iter().filter_map(|it| it.addr);
    addresses
        .map(|address| address.ip())
        .filter(|ip| is_usable(*ip))
        .collect()
}

/// A link-local IPv6 address means nothing without its interface, which a candidate cannot name.
fn is_usable(ip: IpAddr) -> bool {
    let link_local = match ip {
        IpAddr::V4(v4) => v4.is_link_local(),
        IpAddr::V6(v6) => v6.is_unicast_link_local(),
    };
    !(link_local || ip.is_loopback() || ip.is_unspecified() || ip.is_multicast())
}

/// What a connection binds: every usable address, and the loopback if the room's server is reached by it, because then both ends may be on
/// this machine.
pub(crate) fn to_bind(server: &ServerUrl) -> Vec<SocketAddr> {
    let usable = usable();
    let (v4, v6): (Vec<IpAddr>, Vec<IpAddr>) = usable.into_iter().partition(IpAddr::is_ipv4);
    let mut bound: Vec<IpAddr> = v4.into_iter().take(MOST).collect();
    bound.extend(v6.into_iter().take(MOST));
    if server.is_loopback() {
        bound.push(Ipv4Addr::LOCALHOST.into());
    }
    if bound.is_empty() {
        // Offline now; whatever comes will be bound by the next attempt.
        bound.push(Ipv4Addr::UNSPECIFIED.into());
    }
    bound.into_iter().map(|ip| (ip, 0).into()).collect()
}

/// Looks for changes of this machine's addresses.
#[derive(Debug)]
pub(crate) struct Watch {
    known: BTreeSet<IpAddr>,
    looks: Interval,
}

impl Watch {
    pub(crate) fn begin() -> Self {
        let mut looks = interval(LOOK);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        Self {
            known: usable(),
            looks,
        }
    }

    /// Waits until an address of this machine is gone. May be cancelled, in `select!`, without missing one.
    pub(crate) async fn lost(&mut self) {
        loop {
            self.looks.tick().await;
            let now = usable();
            let lost = !self.known.is_subset(&now);
            self.known = now;
            if lost {
                return;
            }
        }
    }
}

/// Whether this machine has an address, the loopback included.
pub(crate) fn has(ip: IpAddr) -> bool {
    ip.is_loopback() || ip == IpAddr::V6(Ipv6Addr::UNSPECIFIED) || usable().contains(&ip)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_that_mean_nothing_elsewhere_are_not_offered() {
        let usable = |text: &str| is_usable(text.parse().expect("an address"));
        for text in [
            "127.0.0.1",
            "169.254.1.1",
            "0.0.0.0",
            "::1",
            "fe80::1",
            "::",
        ] {
            assert!(!usable(text), "{text}");
        }
        for text in [
            "192.168.1.2",
            "10.0.0.1",
            "203.0.113.1",
            "2001:db8::1",
            "fd00::1",
        ] {
            assert!(usable(text), "{text}");
        }
    }

    #[test]
    fn the_loopback_is_bound_only_where_the_server_is_there() {
        let bound = |server: &str| to_bind(&server.parse().expect("an address"));
        let loopback = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        assert!(bound("http://127.0.0.1:8080").contains(&loopback), "here");
        assert!(
            !bound("http://example.org").contains(&loopback),
            "elsewhere"
        );
    }
}
