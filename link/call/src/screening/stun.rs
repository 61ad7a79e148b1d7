//! What the screen reads of STUN and TURN messages (RFC 8489 and RFC 8656). Whether a message is genuine, the library
//! decides.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

const HEADER: usize = 20;
const COOKIE: u32 = 0x2112_A442;

const USERNAME: u16 = 0x0006;
const CHANNEL_NUMBER: u16 = 0x000C;
const XOR_PEER_ADDRESS: u16 = 0x0012;
const DATA: u16 = 0x0013;

/// A message's class and method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    BindingRequest,
    BindingSuccess,
    AllocateRequest,
    ChannelBindRequest,
    SendIndication,
    DataIndication,
    Other,
}

/// The kind of a datagram that begins as STUN does.
pub(super) fn kind(datagram: &[u8]) -> Kind {
    match datagram {
        [0x00, 0x01, ..] => Kind::BindingRequest,
        [0x01, 0x01, ..] => Kind::BindingSuccess,
        [0x00, 0x03, ..] => Kind::AllocateRequest,
        [0x00, 0x09, ..] => Kind::ChannelBindRequest,
        [0x00, 0x16, ..] => Kind::SendIndication,
        [0x00, 0x17, ..] => Kind::DataIndication,
        _ => Kind::Other,
    }
}

/// The peer of a TURN message, and what it sends or has sent.
pub(super) fn relayed(message: &[u8]) -> Option<(SocketAddr, &[u8])> {
    Some((peer(message)?, attribute(message, DATA)?))
}

/// The user fragment of the side that a check is for (RFC 8445, section 7.2.2).
pub(super) fn checked_fragment(request: &[u8]) -> Option<&[u8]> {
    let name = attribute(request, USERNAME)?;
    name.split(|byte| *byte == b':').next()
}

/// The channel that a message binds, and the peer that it is for.
pub(super) fn channel_binding(message: &[u8]) -> Option<(u16, SocketAddr)> {
    let [high, low, ..] = *attribute(message, CHANNEL_NUMBER)? else {
        return None;
    };
    Some((u16::from_be_bytes([high, low]), peer(message)?))
}

/// The number of a channel, and the data in a datagram that carries some.
pub(super) fn channel_data(datagram: &[u8]) -> Option<(u16, &[u8])> {
    let (&[n0, n1, l0, l1], data) = datagram.split_first_chunk()?;
    let length = usize::from(u16::from_be_bytes([l0, l1]));
    Some((u16::from_be_bytes([n0, n1]), data.get(..length)?))
}

/// The value of the first attribute of this type: the library takes the first one, too.
fn attribute(message: &[u8], wanted: u16) -> Option<&[u8]> {
    let &[h, l] = message.get(2..4)? else {
        return None;
    };
    let length = usize::from(u16::from_be_bytes([h, l]));
    let mut rest = message.get(HEADER..HEADER + length)?;
    while let Some((&[t0, t1, l0, l1], after)) = rest.split_first_chunk() {
        let length = usize::from(u16::from_be_bytes([l0, l1]));
        let value = after.get(..length)?;
        if u16::from_be_bytes([t0, t1]) == wanted {
            return Some(value);
        }
        rest = after.get(length.next_multiple_of(4)..)?;
    }
    None
}

/// `XOR-PEER-ADDRESS`.
fn peer(message: &[u8]) -> Option<SocketAddr> {
    let (&[_, family, p0, p1], address) =
        attribute(message, XOR_PEER_ADDRESS)?.split_first_chunk()?;
    let port = u16::from_be_bytes([p0, p1]) ^ (COOKIE >> 16) as u16;
    let ip = match family {
        1 => {
            let bits = u32::from_be_bytes(*address.first_chunk()?);
            IpAddr::V4(Ipv4Addr::from_bits(bits ^ COOKIE))
        }
        2 => {
            // Cookie and transaction.
            let mask = u128::from_be_bytes(*message.get(4..HEADER)?.first_chunk()?);
            let bits = u128::from_be_bytes(*address.first_chunk()?);
            IpAddr::V6(Ipv6Addr::from_bits(bits ^ mask))
        }
        _ => return None,
    };
    Some(SocketAddr::new(ip, port))
}
