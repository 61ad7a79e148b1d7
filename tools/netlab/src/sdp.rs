//! Puts the lab's address into a session description in place of its author's (RFC 8839: candidates, `c=`, `m=`, `a=rtcp`).
//!
//! Knows only what a call with one bundled transport needs. Of its UDP host candidates one is kept, its address replaced; all others (TCP,
//! reflexive, relayed, `.local` names, other components) go, so that no packet goes around the lab.

use std::net::{IpAddr, SocketAddr};

use crate::NetlabError;

/// A session description with the lab's address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rewritten {
    /// The description.
    pub sdp: String,
    /// The address in the original; `None` if it has none (mDNS names): the packets' source is used.
    pub peer: Option<SocketAddr>,
}

/// The parts of a candidate line that the lab needs (RFC 8839, section 5.1).
struct Candidate<'a> {
    foundation: &'a str,
    component: &'a str,
    is_udp: bool,
    priority: u64,
    address: &'a str,
    port: u16,
    kind: &'a str,
    /// What follows the kind without the related address.
    extensions: Vec<&'a str>,
}

impl<'a> Candidate<'a> {
    fn parse(line: &'a str) -> Option<Self> {
        let mut words = line.strip_prefix("a=candidate:")?.split_ascii_whitespace();
        let foundation = words.next()?;
        let component = words.next()?;
        let is_udp = words.next()?.eq_ignore_ascii_case("udp");
        let priority = words.next()?.parse().ok()?;
        let address = words.next()?;
        let port = words.next()?.parse().ok()?;
        let kind = words.next().filter(|&w| w == "typ").and(words.next())?;
        let rest: Vec<&str> = words.collect();
        let extensions = rest
            .chunks(2)
            .filter(|pair| !matches!(pair.first(), Some(&("raddr" | "rport"))))
            .flatten()
            .copied()
            .collect();
        Some(Self {
            foundation,
            component,
            is_udp,
            priority,
            address,
            port,
            kind,
            extensions,
        })
    }

    fn ip(&self) -> Option<IpAddr> {
        self.address.parse().ok()
    }

    /// The preference of a candidate: an explicit address on this machine, and IPv4 as the lab's sockets have.
    fn merit(&self) -> (u8, u64) {
        let rank = match self.ip() {
            Some(IpAddr::V4(ip)) if ip.is_loopback() => 3,
            Some(IpAddr::V4(_)) => 2,
            None => 1,
            Some(IpAddr::V6(_)) => 0,
        };
        (rank, self.priority)
    }

    fn led_to(&self, lab: SocketAddr) -> String {
        let mut line = format!(
            "a=candidate:{} 1 udp {} {} {} typ host",
            self.foundation,
            self.priority,
            lab.ip(),
            lab.port()
        );
        for word in &self.extensions {
            line.push(' ');
            line.push_str(word);
        }
        line
    }
}

/// Replaces the address in a session description by the lab's socket.
///
/// # Errors
/// [`NetlabError::Sdp`] if it is no session description or has no media.
pub fn rewrite(sdp: &str, lab: SocketAddr) -> Result<Rewritten, NetlabError> {
    if !sdp.starts_with("v=0") {
        return Err(NetlabError::Sdp("it does not begin with v=0"));
    }
    let kept = sdp
        .lines()
        .filter_map(|line| Candidate::parse(line.trim_end()))
        .filter(|c| c.is_udp && c.component == "1" && c.kind == "host")
        .max_by_key(Candidate::merit);
    // A description without one (an offerer behind nothing but reflexive candidates) is given one all the same.
    let led = kept.as_ref().map_or_else(
        || {
            format!(
                "a=candidate:1 1 udp 2130706431 {} {} typ host",
                lab.ip(),
                lab.port()
            )
        },
        |candidate| candidate.led_to(lab),
    );
    let peer = kept.as_ref().and_then(|c| {
        c.ip()
            .filter(IpAddr::is_ipv4)
            .map(|ip| SocketAddr::new(ip, c.port))
    });

    let newline = if sdp.contains("\r\n") { "\r\n" } else { "\n" };
    let mut lines: Vec<String> = Vec::new();
    let mut media = 0_usize;
    let mut has_candidate = false;
    // Where a candidate is added to a media section without one: before its end. Only the first (bundling) section gets one.
    for line in sdp.lines().map(str::trim_end) {
        if line.is_empty() {
            continue;
        }
        if line.starts_with("m=") {
            if media == 1 && !has_candidate {
                lines.push(led.clone());
            }
            media += 1;
            has_candidate = false;
            lines.push(with_port(line, lab.port()).ok_or(NetlabError::Sdp("a bad m= line"))?);
        } else if line.starts_with("c=IN ") {
            lines.push(format!("c=IN IP4 {}", lab.ip()));
        } else if line.starts_with("a=rtcp:") {
            lines.push(format!("a=rtcp:{} IN IP4 {}", lab.port(), lab.ip()));
        } else if line.starts_with("a=candidate:") {
            if !has_candidate {
                lines.push(led.clone());
                has_candidate = true;
            }
        } else if line == "a=end-of-candidates" && media == 1 && !has_candidate {
            lines.push(led.clone());
            lines.push(line.to_owned());
            has_candidate = true;
        } else if !line.starts_with("a=remote-candidates:") {
            lines.push(line.to_owned());
        }
    }
    if media == 0 {
        return Err(NetlabError::Sdp("it has no media"));
    }
    if media == 1 && !has_candidate {
        lines.push(led);
    }
    let mut sdp = lines.join(newline);
    sdp.push_str(newline);
    Ok(Rewritten { sdp, peer })
}

/// An `m=` line with the lab's port, unless it refuses the media or leaves it to its bundle (port 0).
fn with_port(line: &str, port: u16) -> Option<String> {
    let (kind, rest) = line.split_once(' ')?;
    let (old, rest) = rest.split_once(' ')?;
    Some(if old == "0" {
        line.to_owned()
    } else {
        format!("{kind} {port} {rest}")
    })
}

#[cfg(test)]
#[path = "sdp_tests.rs"]
mod tests;
