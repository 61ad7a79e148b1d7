//! Which of the other side's ICE candidates are tried: each is an address to which this side sends, by the word of whoever made the offer.

use std::collections::BTreeSet;
use std::net::{IpAddr, SocketAddr};

/// Candidates that are tried. A machine with two networks, IPv4 and IPv6, STUN and a relay over UDP and TCP has some ten.
const MOST: usize = 16;

/// Private addresses among them, at most: two people in one network find each other, but nobody has this side look through its own network.
const MOST_PRIVATE: usize = 4;

/// The description with the candidates that may be tried. `is_local`: this side is on its machine's loopback only, and so may the other be.
pub(crate) fn screened(sdp: &str, is_local: bool) -> String {
    let mut private = BTreeSet::new();
    let mut tried = 0;
    let mut is_kept = |line: &str| {
        let Some(candidate) = line.strip_prefix("a=candidate:") else {
            return true;
        };
        // RFC 8839, section 5.1: foundation, component, transport, priority, address, port.
        let mut words = candidate.split_ascii_whitespace().skip(4);
        let (Some(address), Some(port)) = (words.next(), words.next()) else {
            return false;
        };
        let is_wanted = match address.parse::<IpAddr>() {
            Ok(ip) => is_unicast(ip, is_local) && (!is_private(ip) || private.insert(ip)),
            // A browser's name for an address of its own network.
            Err(_) => address.ends_with(".local"),
        };
        let has_port = port.parse::<u16>().is_ok_and(|port| port > 0);
        if !is_wanted || !has_port || tried >= MOST || private.len() > MOST_PRIVATE {
            return false;
        }
        tried += 1;
        true
    };
    let lines = sdp.split_inclusive('\n');
    lines.filter(|line| is_kept(line)).collect()
}

/// Whether one machine has the address, and another may be sent to it.
fn is_unicast(ip: IpAddr, is_local: bool) -> bool {
    match ip.to_canonical() {
        IpAddr::V4(ip) => {
            (is_local || !ip.is_loopback())
                && !ip.is_unspecified()
                && !ip.is_multicast()
                && !ip.is_broadcast()
        }
        IpAddr::V6(ip) => {
            (is_local || !ip.is_loopback()) && !ip.is_unspecified() && !ip.is_multicast()
        }
    }
}

/// Whether the address is one of a network that the internet does not reach.
fn is_private(ip: IpAddr) -> bool {
    match ip.to_canonical() {
        IpAddr::V4(ip) => ip.is_private() || ip.is_link_local() || ip.is_loopback(),
        IpAddr::V6(ip) => ip.is_unique_local() || ip.is_unicast_link_local() || ip.is_loopback(),
    }
}

/// Whether one of these addresses is of the machine's loopback.
pub(crate) fn has_loopback(addresses: &[SocketAddr]) -> bool {
    addresses.iter().any(|address| address.ip().is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(addresses: &[&str]) -> String {
        let lines = addresses.iter().enumerate().map(|(number, address)| {
            format!("a=candidate:{number} 1 udp 2130706431 {address} 5000 typ host\r\n")
        });
        let candidates: String = lines.collect();
        format!("v=0\r\nm=application 9\r\n{candidates}a=end-of-candidates\r\n")
    }

    fn kept(addresses: &[&str], is_local: bool) -> Vec<String> {
        let sdp = screened(&offer(addresses), is_local);
        assert!(sdp.starts_with("v=0") && sdp.ends_with("a=end-of-candidates\r\n"));
        let lines = sdp.lines().filter(|line| line.starts_with("a=candidate:"));
        let address = |line: &str| line.split(' ').nth(4).expect("an address").to_owned();
        lines.map(address).collect()
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
        let public: Vec<String> = (0..400)
            .map(|n| format!("203.0.{}.{}", n / 200, n % 200 + 1))
            .collect();
        let public: Vec<&str> = public.iter().map(String::as_str).collect();
        assert_eq!(kept(&public, false).len(), MOST);
        let private: Vec<String> = (1..=200).map(|n| format!("192.168.1.{n}")).collect();
        let private: Vec<&str> = private.iter().map(String::as_str).collect();
        assert_eq!(kept(&private, false).len(), MOST_PRIVATE);
    }

    #[test]
    fn what_is_no_machines_address_is_left_out() {
        let wrong = [
            "127.0.0.1",
            "::1",
            "0.0.0.0",
            "255.255.255.255",
            "224.0.0.251",
            "ff02::fb",
            "::ffff:127.0.0.1",
            "internal.example",
            "",
        ];
        assert!(kept(&wrong, false).is_empty());
        assert_eq!(
            kept(&["127.0.0.1", "::1"], true).len(),
            2,
            "all on one machine"
        );
        let zero = offer(&["203.0.113.5"]).replace(" 5000 ", " 0 ");
        assert!(!screened(&zero, false).contains("candidate:"), "port 0");
    }
}
