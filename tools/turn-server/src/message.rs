//! STUN messages (RFC 8489) as TURN (RFC 8656) uses them: read in place and written, with MESSAGE-INTEGRITY and FINGERPRINT.
//!
//! Written here because what reads strangers' packets should be short enough to be read whole: the codecs on crates.io copy every attribute
//! or bring a client along.

use hmac::{Hmac, Mac};
use sha1::Sha1;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

const COOKIE: [u8; 4] = 0x2112_A442_u32.to_be_bytes();
const HEADER: usize = 20;
/// MESSAGE-INTEGRITY with its type and length; FINGERPRINT with them.
const INTEGRITY_BYTES: usize = 24;
const FINGERPRINT_BYTES: usize = 8;
const FINGERPRINT_XOR: u32 = 0x5354_554e;

/// A message's method and class, as the first two bytes have them.
pub(crate) mod kind {
    pub(crate) const BINDING_REQUEST: u16 = 0x0001;
    pub(crate) const ALLOCATE_REQUEST: u16 = 0x0003;
    pub(crate) const REFRESH_REQUEST: u16 = 0x0004;
    pub(crate) const CREATE_PERMISSION_REQUEST: u16 = 0x0008;
    pub(crate) const CHANNEL_BIND_REQUEST: u16 = 0x0009;
    pub(crate) const SEND_INDICATION: u16 = 0x0016;
    pub(crate) const DATA_INDICATION: u16 = 0x0017;
    pub(crate) const SUCCESS: u16 = 0x0100;
    pub(crate) const ERROR: u16 = 0x0110;
}

/// Types of attributes.
pub(crate) mod attribute {
    pub(crate) const USERNAME: u16 = 0x0006;
    pub(crate) const MESSAGE_INTEGRITY: u16 = 0x0008;
    pub(crate) const ERROR_CODE: u16 = 0x0009;
    pub(crate) const UNKNOWN_ATTRIBUTES: u16 = 0x000A;
    pub(crate) const CHANNEL_NUMBER: u16 = 0x000C;
    pub(crate) const LIFETIME: u16 = 0x000D;
    pub(crate) const XOR_PEER_ADDRESS: u16 = 0x0012;
    pub(crate) const DATA: u16 = 0x0013;
    pub(crate) const REALM: u16 = 0x0014;
    pub(crate) const NONCE: u16 = 0x0015;
    pub(crate) const XOR_RELAYED_ADDRESS: u16 = 0x0016;
    pub(crate) const REQUESTED_ADDRESS_FAMILY: u16 = 0x0017;
    pub(crate) const REQUESTED_TRANSPORT: u16 = 0x0019;
    pub(crate) const XOR_MAPPED_ADDRESS: u16 = 0x0020;
    pub(crate) const FINGERPRINT: u16 = 0x8028;
}

/// A transaction's number.
pub(crate) type Transaction = [u8; 12];

/// A message that was checked for shape: its attributes lie within it, and its fingerprint, if it has one, fits.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Message<'a> {
    bytes: &'a [u8],
}

impl<'a> Message<'a> {
    /// Reads one that is all of `bytes`.
    pub(crate) fn read(bytes: &'a [u8]) -> Option<Self> {
        let header = bytes.first_chunk::<HEADER>()?;
        let [a, _, c, d, ..] = *header;
        let length = usize::from(u16::from_be_bytes([c, d]));
        let whole = a & 0xC0 == 0
            && header[4..8] == COOKIE
            && length.is_multiple_of(4)
            && HEADER + length == bytes.len();
        if !whole {
            return None;
        }
        let message = Self { bytes };
        let mut end = HEADER;
        for (at, kind, value) in message.attributes() {
            if kind == attribute::FINGERPRINT {
                let sum = crc32fast::hash(&with_length(bytes.get(..at)?, at + FINGERPRINT_BYTES)?);
                if value != (sum ^ FINGERPRINT_XOR).to_be_bytes() {
                    return None;
                }
            }
            end = at + 4 + value.len().next_multiple_of(4);
        }
        (end == bytes.len()).then_some(message)
    }

    pub(crate) fn kind(&self) -> u16 {
        u16::from_be_bytes([self.bytes[0], self.bytes[1]])
    }

    pub(crate) fn transaction(&self) -> Transaction {
        let mut transaction = [0; 12];
        transaction.copy_from_slice(&self.bytes[8..HEADER]);
        transaction
    }

    /// Offset, type and value of each attribute, up to the first that does not lie within the message.
    fn attributes(&self) -> impl Iterator<Item = (usize, u16, &'a [u8])> + use<'a> {
        let bytes = self.bytes;
        let mut at = HEADER;
        std::iter::from_fn(move || {
            let [a, b, c, d] = *bytes.get(at..)?.first_chunk::<4>()?;
            let length = usize::from(u16::from_be_bytes([c, d]));
            let value = bytes.get(at + 4..at + 4 + length)?;
            bytes.get(..at + 4 + length.next_multiple_of(4))?;
            let found = (at, u16::from_be_bytes([a, b]), value);
            at += 4 + length.next_multiple_of(4);
            Some(found)
        })
    }

    /// The attributes of this type that MESSAGE-INTEGRITY covers; all, where there is none.
    pub(crate) fn all(&self, wanted: u16) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        self.attributes()
            .take_while(|(_, kind, _)| *kind != attribute::MESSAGE_INTEGRITY)
            .filter(move |(_, kind, _)| *kind == wanted)
            .map(|(_, _, value)| value)
    }

    /// The first attribute of this type.
    pub(crate) fn get(&self, wanted: u16) -> Option<&'a [u8]> {
        self.all(wanted).next()
    }

    pub(crate) fn text(&self, wanted: u16) -> Option<&'a str> {
        std::str::from_utf8(self.get(wanted)?).ok()
    }

    pub(crate) fn number(&self, wanted: u16) -> Option<u32> {
        Some(u32::from_be_bytes(self.get(wanted)?.try_into().ok()?))
    }

    /// The first types that must be understood and are not.
    pub(crate) fn not_understood(&self) -> Vec<u16> {
        use attribute as a;
        self.attributes()
            .map(|(_, kind, _)| kind)
            .filter(|kind| {
                *kind < 0x8000
                    && !matches!(
                        *kind,
                        a::USERNAME
                            | a::MESSAGE_INTEGRITY
                            | a::CHANNEL_NUMBER
                            | a::LIFETIME
                            | a::XOR_PEER_ADDRESS
                            | a::DATA
                            | a::REALM
                            | a::NONCE
                            | a::REQUESTED_ADDRESS_FAMILY
                            | a::REQUESTED_TRANSPORT
                    )
            })
            .take(8)
            .collect()
    }

    pub(crate) fn has_integrity(&self) -> bool {
        self.attributes()
            .any(|(_, kind, _)| kind == attribute::MESSAGE_INTEGRITY)
    }

    /// Whether MESSAGE-INTEGRITY was made with `key`. The comparison takes the same time wherever it differs.
    pub(crate) fn verify(&self, key: &[u8]) -> bool {
        let found = self
            .attributes()
            .find(|(_, kind, _)| *kind == attribute::MESSAGE_INTEGRITY);
        let Some((at, _, value)) = found else {
            return false;
        };
        let signed = self
            .bytes
            .get(..at)
            .and_then(|before| with_length(before, at + INTEGRITY_BYTES));
        signed.is_some_and(|signed| sign(key, &signed).verify_slice(value).is_ok())
    }

    /// The addresses in XOR-PEER-ADDRESS; `None` for one that is malformed.
    pub(crate) fn peers(&self) -> impl Iterator<Item = Option<SocketAddr>> + use<'a> {
        let transaction = self.transaction();
        self.all(attribute::XOR_PEER_ADDRESS)
            .map(move |value| read_address(value, &transaction))
    }
}

/// `before` with the header's length as if the message were `bytes` long.
fn with_length(before: &[u8], bytes: usize) -> Option<Vec<u8>> {
    let mut signed = before.to_vec();
    let length = u16::try_from(bytes.checked_sub(HEADER)?).ok()?;
    signed.get_mut(2..4)?.copy_from_slice(&length.to_be_bytes());
    Some(signed)
}

fn sign(key: &[u8], bytes: &[u8]) -> Hmac<Sha1> {
    crate::credentials::hmac(key, bytes)
}

fn read_address(value: &[u8], transaction: &Transaction) -> Option<SocketAddr> {
    let [_, family, p, q, rest @ ..] = value else {
        return None;
    };
    let port = u16::from_be_bytes([p ^ COOKIE[0], q ^ COOKIE[1]]);
    let ip = match family {
        1 => {
            let bytes: [u8; 4] = rest.try_into().ok()?;
            IpAddr::V4(Ipv4Addr::from_bits(
                u32::from_be_bytes(bytes) ^ u32::from_be_bytes(COOKIE),
            ))
        }
        2 => {
            let bytes: [u8; 16] = rest.try_into().ok()?;
            let mask = mask(transaction);
            IpAddr::V6(Ipv6Addr::from_bits(
                u128::from_be_bytes(bytes) ^ u128::from_be_bytes(mask),
            ))
        }
        _ => return None,
    };
    Some(SocketAddr::new(ip, port))
}

/// What the bytes of an IPv6 address are combined with.
fn mask(transaction: &Transaction) -> [u8; 16] {
    let mut mask = [0; 16];
    mask[..4].copy_from_slice(&COOKIE);
    mask[4..].copy_from_slice(transaction);
    mask
}

/// A message as it is written.
#[derive(Debug)]
pub(crate) struct Writer {
    bytes: Vec<u8>,
    transaction: Transaction,
}

impl Writer {
    pub(crate) fn new(kind: u16, transaction: Transaction) -> Self {
        let mut bytes = Vec::with_capacity(160);
        bytes.extend_from_slice(&kind.to_be_bytes());
        bytes.extend_from_slice(&[0, 0]);
        bytes.extend_from_slice(&COOKIE);
        bytes.extend_from_slice(&transaction);
        Self { bytes, transaction }
    }

    /// Adds an attribute; what is longer than a packet is cut.
    pub(crate) fn add(mut self, kind: u16, value: &[u8]) -> Self {
        let length = u16::try_from(value.len()).unwrap_or(0);
        self.bytes.extend_from_slice(&kind.to_be_bytes());
        self.bytes.extend_from_slice(&length.to_be_bytes());
        self.bytes.extend_from_slice(&value[..usize::from(length)]);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.set_length(0);
        self
    }

    pub(crate) fn address(self, kind: u16, address: SocketAddr) -> Self {
        let port = address.port() ^ u16::from_be_bytes([COOKIE[0], COOKIE[1]]);
        let [p, q] = port.to_be_bytes();
        match address.ip().to_canonical() {
            IpAddr::V4(v4) => {
                let [a, b, c, d] = (v4.to_bits() ^ u32::from_be_bytes(COOKIE)).to_be_bytes();
                self.add(kind, &[0, 1, p, q, a, b, c, d])
            }
            IpAddr::V6(v6) => {
                let mask = u128::from_be_bytes(mask(&self.transaction));
                let mut value = [0, 2, p, q].to_vec();
                value.extend_from_slice(&(v6.to_bits() ^ mask).to_be_bytes());
                self.add(kind, &value)
            }
        }
    }

    /// ERROR-CODE, with the code's reason.
    pub(crate) fn error(self, code: u16, reason: &str) -> Self {
        let [class, number] = [code / 100, code % 100].map(|part| part.to_be_bytes()[1]);
        let mut value = vec![0, 0, class, number];
        value.extend_from_slice(reason.as_bytes());
        self.add(attribute::ERROR_CODE, &value)
    }

    /// Adds MESSAGE-INTEGRITY.
    pub(crate) fn signed(mut self, key: &[u8]) -> Self {
        self.set_length(INTEGRITY_BYTES);
        let tag = sign(key, &self.bytes).finalize().into_bytes();
        self.add(attribute::MESSAGE_INTEGRITY, &tag)
    }

    /// Adds FINGERPRINT, and ends.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        self.set_length(FINGERPRINT_BYTES);
        let sum = crc32fast::hash(&self.bytes) ^ FINGERPRINT_XOR;
        self.add(attribute::FINGERPRINT, &sum.to_be_bytes()).bytes
    }

    /// Ends without a fingerprint.
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// The header's length, as if `more` bytes had been added.
    fn set_length(&mut self, more: usize) {
        let length = u16::try_from(self.bytes.len() - HEADER + more).unwrap_or(u16::MAX);
        self.bytes[2..4].copy_from_slice(&length.to_be_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// RFC 5769, section 2.4: a request with long-term authentication. User "マトリックス", password "The\u{ad}M\u{aa}tr\u{2168}" (after
    /// SASLprep "TheMatrIX"), realm "example.org".
    const SAMPLE: &str = "000100602112a44278ad3433c6ad72c029da412e00060012e3839ee38388e383aae38383e382afe382b900000015001c\
        662f2f3439396b39353464364f4c33346f4c394653547679363473410014000b6578616d706c652e6f7267000008\
        0014f67024656dd64a3e02b8e0712e85c9a28ca89666";

    fn sample() -> Vec<u8> {
        let hex: Vec<u8> = SAMPLE.bytes().filter(u8::is_ascii_hexdigit).collect();
        hex.chunks(2)
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).expect("ASCII"), 16))
            .collect::<Result<_, _>>()
            .expect("hexadecimal")
    }

    #[test]
    fn the_request_of_rfc_5769_is_read_and_its_integrity_holds() {
        let bytes = sample();
        let message = Message::read(&bytes).expect("the RFC's own");
        assert_eq!(message.kind(), kind::BINDING_REQUEST);
        assert_eq!(message.text(attribute::REALM), Some("example.org"));
        let user = message.text(attribute::USERNAME).expect("a name");
        assert_eq!(user, "\u{30de}\u{30c8}\u{30ea}\u{30c3}\u{30af}\u{30b9}");
        let key = crate::credentials::long_term_key(user, "example.org", "TheMatrIX");
        assert!(message.verify(&key), "its integrity");
        let other = crate::credentials::long_term_key(user, "example.org", "TheMatrix");
        assert!(!message.verify(&other), "not with another password");
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 1;
            let holds = Message::read(&changed).is_some_and(|message| message.verify(&key));
            // The last two bytes of the name are padding, and so is the realm's, but all are signed.
            assert!(!holds, "byte {at} changed");
        }
    }

    /// RFC 5769, section 2.2: XOR-MAPPED-ADDRESS 192.0.2.1:32853; section 2.3 for IPv6.
    #[test]
    fn addresses_are_written_as_rfc_5769_has_them() {
        let transaction = [
            0xb7, 0xe7, 0xa7, 0x01, 0xbc, 0x34, 0xd6, 0x86, 0xfa, 0x87, 0xdf, 0xae,
        ];
        let written = |address: &str| {
            let address = address.parse().expect("an address");
            Writer::new(0x0101, transaction)
                .address(attribute::XOR_MAPPED_ADDRESS, address)
                .into_bytes()
        };
        let v4 = written("192.0.2.1:32853");
        assert_eq!(
            v4[20..],
            [
                0x00, 0x20, 0x00, 0x08, 0x00, 0x01, 0xa1, 0x47, 0xe1, 0x12, 0xa6, 0x43
            ]
        );
        let v6 = written("[2001:db8:1234:5678:11:2233:4455:6677]:32853");
        assert_eq!(
            v6[20..],
            [
                0x00, 0x20, 0x00, 0x14, 0x00, 0x02, 0xa1, 0x47, 0x01, 0x13, 0xa9, 0xfa, 0xa5, 0xd3,
                0xf1, 0x79, 0xbc, 0x25, 0xf4, 0xb5, 0xbe, 0xd2, 0xb9, 0xd9
            ]
        );
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..200), cookie: bool) {
            let mut bytes = bytes;
            if cookie && bytes.len() >= HEADER {
                bytes[0] &= 0x3f;
                bytes[4..8].copy_from_slice(&COOKIE);
                let length = u16::try_from(bytes.len() - HEADER).unwrap_or(0);
                bytes[2..4].copy_from_slice(&length.to_be_bytes());
            }
            if let Some(message) = Message::read(&bytes) {
                let _ = (message.kind(), message.not_understood(), message.verify(b"key"));
                let _ = message.peers().count();
            }
        }

        #[test]
        fn what_is_written_is_read_back(data in prop::collection::vec(any::<u8>(), 0..64), port: u16, ip: u128) {
            let address = SocketAddr::new(Ipv6Addr::from_bits(ip).into(), port);
            let canonical = SocketAddr::new(address.ip().to_canonical(), port);
            let bytes = Writer::new(kind::SEND_INDICATION, [7; 12])
                .address(attribute::XOR_PEER_ADDRESS, address)
                .add(attribute::DATA, &data)
                .signed(b"key")
                .finish();
            let message = Message::read(&bytes).expect("well-formed");
            prop_assert_eq!(message.peers().collect::<Vec<_>>(), vec![Some(canonical)]);
            prop_assert_eq!(message.get(attribute::DATA), Some(data.as_slice()));
            prop_assert!(message.verify(b"key"));
        }
    }
}
