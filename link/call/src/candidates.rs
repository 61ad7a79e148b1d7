//! Which of the other side's ICE candidates are tried: each is an address to which this side sends, by the word of whoever made the offer.

use crate::scope::Scope;
use crate::sdp::{Candidate, Host};
use std::collections::BTreeSet;
use std::net::{IpAddr, SocketAddr};

/// Candidates that are tried. A machine with two networks, IPv4 and IPv6, STUN and a relay over UDP and TCP has some ten.
const MOST: usize = 16;

/// Private addresses among them, at most: two people in one network find each other, but nobody has this side look through its own network.
const MOST_PRIVATE: usize = 4;

/// Those that are tried. `is_local`: this side is on its machine's loopback only, and so may the other be.
pub(crate) fn screened(candidates: &[Candidate], is_local: bool) -> Vec<&Candidate> {
    let mut private = BTreeSet::new();
    let may_be_tried = |candidate: &&Candidate| {
        // RTP and RTCP share one component, and the library has no TCP.
        let is_usable = candidate.component == 1 && candidate.is_udp && candidate.port > 0;
        if !is_usable || candidate.kind.is_empty() {
            return false;
        }
        let is_private = match &candidate.host {
            Host::Ip(ip) if !is_unicast(*ip, is_local) => return false,
            Host::Ip(ip) => is_private(*ip),
            Host::Mdns(_) => true,
            Host::Name => return false,
        };
        !is_private || (private.len() < MOST_PRIVATE && private.insert(candidate.host.clone()))
    };
    candidates.iter().filter(may_be_tried).take(MOST).collect()
}

/// Whether one machine has the address, and another may be sent to it.
fn is_unicast(ip: IpAddr, is_local: bool) -> bool {
    match Scope::of(ip) {
        None => false,
        Some(Scope::Machine) => is_local,
        Some(_) => true,
    }
}

/// Whether the address is one of a network that the internet does not reach.
fn is_private(ip: IpAddr) -> bool {
    Scope::of(ip).is_some_and(|scope| scope < Scope::Internet)
}

/// Whether one of these addresses is of the machine's loopback.
pub(crate) fn has_loopback(addresses: &[SocketAddr]) -> bool {
    addresses.iter().any(|address| address.ip().is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sdp::{Description, tests::offer};

    fn tried(lines: &[String], is_local: bool) -> Vec<String> {
        let lines = lines.iter().map(|line| format!("a=candidate:{line}\r\n"));
        let offer = Description::read(&offer(&lines.collect::<String>())).expect("an offer");
        let tried = screened(&offer.candidates, is_local);
        tried.into_iter().map(|it| it.host.to_string()).collect()
    }

    fn kept(addresses: &[&str], is_local: bool) -> Vec<String> {
        let lines = addresses.iter().enumerate();
        let lines =
            lines.map(|(n, address)| format!("{n} 1 udp 2130706431 {address} 5000 typ host"));
        tried(&lines.collect::<Vec<_>>(), is_local)
    }

    #[test]
    fn a_usual_offer_passes_as_it_is() {
        let usual = [
            "192.168.1.7",
            "fd00::7",
            "2001:db8::7",
            "203.0.113.5",
            "198.51.100.9",
            "8d5b5f3e-0000-4000-8000-1c6a0f8b2d11.local",
        ];
        assert_eq!(kept(&usual, false), usual);
    }

    #[test]
    fn four_hundred_candidates_are_sixteen_and_a_network_is_not_looked_through() {
        let all = |address: &dyn Fn(usize) -> String| {
            let all: Vec<String> = (0..400).map(address).collect();
            kept(&all.iter().map(String::as_str).collect::<Vec<_>>(), false).len()
        };
        assert_eq!(all(&|n| format!("203.0.{}.{}", n / 200, n % 200 + 1)), MOST);
        assert_eq!(
            all(&|n| format!("10.0.{}.{}", n / 200, n % 200 + 1)),
            MOST_PRIVATE
        );
        assert_eq!(
            all(&|n| format!("n{n}.local")),
            MOST_PRIVATE,
            "names of a network"
        );
        let mut mixed: Vec<String> = (1..=9).map(|n| format!("192.168.1.{n}")).collect();
        mixed.push("203.0.113.5".to_owned());
        let mixed: Vec<&str> = mixed.iter().map(String::as_str).collect();
        assert_eq!(
            kept(&mixed, false).len(),
            MOST_PRIVATE + 1,
            "others are still tried"
        );
    }

    #[test]
    fn an_address_that_no_other_machine_has_is_left_out() {
        let wrong = [
            "127.0.0.1",
            "::1",
            "0.0.0.0",
            "255.255.255.255",
            "224.0.0.251",
            "ff02::fb",
            "::ffff:127.0.0.1",
            "internal.example",
            "a.b.local",
        ];
        assert!(kept(&wrong, false).is_empty());
        assert_eq!(
            kept(&["127.0.0.1", "::1"], true).len(),
            2,
            "all on one machine"
        );
        for unusable in [
            "1 1 udp 1 203.0.113.5 0 typ host",
            "1 2 udp 1 203.0.113.5 5000 typ host",
            "1 1 tcp 1 203.0.113.5 9 typ host tcptype active",
            "1 1 udp 1 203.0.113.5 5000 typ other",
        ] {
            assert!(
                tried(&[unusable.to_owned()], false).is_empty(),
                "{unusable}"
            );
        }
    }
}
