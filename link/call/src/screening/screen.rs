//! The rules, over both directions of a connection's datagrams:
//!
//! - STUN passes from every source: the library checks it by the connection's password, but resolves role conflicts
//!   before that, so requests have to name the connection, which only signaling tells. A request of a source that has
//!   not been answered passes while fewer than [`MOST`] have: each becomes a candidate, to which this side sends.
//! - Of TURN, data passes only from a server at which this side asks for an allocation, and is then screened as the
//!   peer's.
//! - DTLS, RTP and RTCP pass only from the other side: from an address to which this side has sent DTLS or RTP, as the
//!   library does only to the remote address of the selected pair, or whose STUN request this side has answered, as the
//!   library does only if it has the right password.
//! - DTLS is bounded as [`super::dtls`] says, and SSRCs in number.
//! - Everything else is dropped.

use super::dtls::Records;
use super::sctp::Association;
use super::stun::{self, Kind};
use std::net::SocketAddr;

/// Addresses of one kind that a connection remembers. A side has 16 candidates at most, and few new addresses in a
/// call.
const MOST: usize = 64;

/// SSRCs of RTP, and of RTCP. A voice has one, and its receiver's reports have one; either changes only after a
/// collision.
const SSRCS: usize = 16;

/// First bytes of DTLS, of TURN's channels, and of RTP and RTCP (RFC 7983); DTLS has no other types of records.
const STUN: std::ops::RangeInclusive<u8> = 0..=3;
const DTLS: std::ops::RangeInclusive<u8> = 20..=23;
const CHANNEL: std::ops::RangeInclusive<u8> = 64..=79;
const RTP: std::ops::RangeInclusive<u8> = 128..=191;
/// Second bytes of RTCP.
const RTCP: std::ops::RangeInclusive<u8> = 192..=223;

/// Where a packet comes from or goes to: an address, or one behind a TURN server's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    relay: Option<SocketAddr>,
    address: SocketAddr,
}

/// The number of a peer between one socket and a TURN server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Channel {
    socket: u32,
    relay: SocketAddr,
    number: u16,
    peer: SocketAddr,
}

/// One connection's.
#[derive(Debug, Default)]
pub(super) struct Screen {
    is_closed: bool,
    /// This side's ICE user fragment.
    fragment: Option<Vec<u8>>,
    peers: Vec<Place>,
    relays: Vec<SocketAddr>,
    channels: Vec<Channel>,
    records: Records,
    pub(super) association: Association,
    rtp: Vec<u32>,
    rtcp: Vec<u32>,
}

impl Screen {
    pub(super) fn close(&mut self) {
        self.is_closed = true;
    }

    /// This side describes its connection by this ICE user fragment.
    pub(super) fn describe(&mut self, fragment: &str) {
        self.fragment = Some(fragment.into());
    }

    /// This side sends a datagram from one of its sockets.
    pub(super) fn sends(&mut self, socket: u32, to: SocketAddr, datagram: &[u8]) {
        let Some(first) = datagram.first() else {
            return;
        };
        let relay = Some(to);
        if STUN.contains(first) {
            match stun::kind(datagram) {
                Kind::AllocateRequest => remember(&mut self.relays, to),
                Kind::ChannelBindRequest => {
                    if let Some((number, peer)) = stun::channel_binding(datagram) {
                        let channel = Channel {
                            socket,
                            relay: to,
                            number,
                            peer,
                        };
                        remember(&mut self.channels, channel);
                    }
                }
                Kind::SendIndication => {
                    if let Some((address, data)) = stun::relayed(datagram) {
                        self.sends_to(Place { relay, address }, data);
                    }
                }
                _ => self.sends_to(direct(to), datagram),
            }
        } else if CHANNEL.contains(first) {
            if let Some((number, data)) = stun::channel_data(datagram)
                && let Some(address) = self.peer_of(socket, to, number)
            {
                self.sends_to(Place { relay, address }, data);
            }
        } else {
            self.sends_to(direct(to), datagram);
        }
    }

    fn sends_to(&mut self, to: Place, packet: &[u8]) {
        match packet.first() {
            Some(first) if STUN.contains(first) && stun::kind(packet) == Kind::BindingSuccess => {
                remember(&mut self.peers, to);
            }
            Some(first) if DTLS.contains(first) => {
                self.records.sends(packet);
                remember(&mut self.peers, to);
            }
            Some(first) if RTP.contains(first) => remember(&mut self.peers, to),
            _ => {}
        }
    }

    /// Whether the library is to have a datagram that one of the sockets received.
    pub(super) fn admits(&mut self, socket: u32, from: SocketAddr, datagram: &[u8]) -> bool {
        let Some(first) = datagram.first().filter(|_| !self.is_closed) else {
            return false;
        };
        let is_data = stun::kind(datagram) == Kind::DataIndication;
        if !is_data && !CHANNEL.contains(first) {
            return self.admits_from(direct(from), datagram);
        }
        let relayed = if !self.relays.contains(&from) {
            None
        } else if is_data {
            stun::relayed(datagram)
        } else {
            stun::channel_data(datagram).and_then(|(number, data)| {
                let peer = self.peer_of(socket, from, number)?;
                Some((peer, data))
            })
        };
        relayed.is_some_and(|(address, data)| {
            let relay = Some(from);
            self.admits_from(Place { relay, address }, data)
        })
    }

    fn admits_from(&mut self, from: Place, packet: &[u8]) -> bool {
        let Some(first) = packet.first() else {
            return false;
        };
        let is_known = self.peers.contains(&from);
        if STUN.contains(first) {
            stun::kind(packet) != Kind::BindingRequest
                || self.is_named_by(packet) && (is_known || self.peers.len() < MOST)
        } else if DTLS.contains(first) {
            is_known && self.records.admits(packet)
        } else if RTP.contains(first) {
            is_known && self.admits_rtp(packet)
        } else {
            false
        }
    }

    fn is_named_by(&self, request: &[u8]) -> bool {
        let named = stun::checked_fragment(request);
        named.is_some() && named == self.fragment.as_deref()
    }

    /// Whether a packet has one of the first SSRCs that came.
    fn admits_rtp(&mut self, packet: &[u8]) -> bool {
        let is_rtcp = packet.get(1).is_some_and(|kind| RTCP.contains(kind));
        let (known, offset) = if is_rtcp {
            (&mut self.rtcp, 4)
        } else {
            (&mut self.rtp, 8)
        };
        let Some(ssrc) = packet.get(offset..).and_then(<[u8]>::first_chunk) else {
            return false;
        };
        let ssrc = u32::from_be_bytes(*ssrc);
        known.contains(&ssrc)
            || (known.len() < SSRCS && {
                known.push(ssrc);
                true
            })
    }

    fn peer_of(&self, socket: u32, relay: SocketAddr, number: u16) -> Option<SocketAddr> {
        // The newest: a number may be bound to another peer after ten minutes.
        let mut channels = self.channels.iter().rev();
        let channel =
            channels.find(|it| it.socket == socket && it.relay == relay && it.number == number)?;
        Some(channel.peer)
    }
}

fn direct(address: SocketAddr) -> Place {
    Place {
        relay: None,
        address,
    }
}

/// Makes `newest` the last one; the oldest goes where there are too many.
fn remember<T: PartialEq>(all: &mut Vec<T>, newest: T) {
    if all.last() == Some(&newest) {
        return;
    }
    if let Some(at) = all.iter().position(|it| *it == newest) {
        all.remove(at);
    } else if all.len() >= MOST {
        all.remove(0);
    }
    all.push(newest);
}
