//! Bounds on the DTLS 1.2 records (RFC 6347) of one connection, for a host without a link as for the other side itself:
//! encrypted records have their type and epoch in clear.
//!
//! A message of the handshake is repeated 7 times by this library (each second), 5 times in 2 s and 10 times in a
//! minute by browsers (first after 50 ms, then after twice as long), 6 times in a minute by OpenSSL. It is one
//! fragment, but for a certificate of RSA, which is four at most. So an honest side has sent 40 fragments of a message
//! when it gives up, and some 30 KB in all.

/// Messages of a handshake: their numbers begin at 0, and the longest handshake has 8.
const MESSAGES: usize = 16;
/// Fragments of one message, repetitions among them. The library calls itself once for each.
const FRAGMENTS: u8 = 64;
/// Bytes of handshake in clear.
const HANDSHAKE_BYTES: usize = 256 << 10;
/// Encrypted records of handshake: one, and its repetitions. It has 24 bytes, and 24 more of nonce and tag.
const SEALED: u8 = 64;
const SEALED_BYTES: usize = 256;
/// Records that the library keeps for later until the handshake ends: those of the next epoch, and changes of the
/// cipher.
const EARLY: u8 = 64;
const EARLY_BYTES: usize = 64 << 10;

const HEADER: usize = 13;
const FRAGMENT_HEADER: usize = 12;

const CHANGE_CIPHER_SPEC: u8 = 20;
const ALERT: u8 = 21;
const HANDSHAKE: u8 = 22;
const APPLICATION_DATA: u8 = 23;

/// Counts of a connection's records.
#[derive(Debug, Default)]
pub(super) struct Records {
    fragments: [u8; MESSAGES],
    handshake_bytes: usize,
    sealed: u8,
    early: u8,
    early_bytes: usize,
    /// This side has sent data, as it does only after the handshake.
    established: bool,
}

struct Record<'a> {
    content: u8,
    epoch: u16,
    body: &'a [u8],
}

impl Records {
    /// This side sends a datagram.
    pub(super) fn sends(&mut self, datagram: &[u8]) {
        let mut rest = datagram;
        while !self.established
            && let Some((record, after)) = next(rest)
        {
            self.established = record.content == APPLICATION_DATA;
            rest = after;
        }
    }

    /// Whether the library is to have this datagram: whether each of its records is one.
    pub(super) fn admits(&mut self, datagram: &[u8]) -> bool {
        let mut rest = datagram;
        while !rest.is_empty() {
            let Some((record, after)) = next(rest) else {
                return false;
            };
            if !self.admits_record(&record) {
                return false;
            }
            rest = after;
        }
        true
    }

    fn admits_record(&mut self, record: &Record<'_>) -> bool {
        match (record.content, record.epoch) {
            (HANDSHAKE, 0) => self.admits_handshake(record.body),
            (ALERT, 0) => true,
            (CHANGE_CIPHER_SPEC, 0) => self.counts_early(record),
            (HANDSHAKE, 1) => {
                record.body.len() <= SEALED_BYTES
                    && counts(&mut self.sealed, SEALED)
                    && self.counts_early(record)
            }
            (ALERT | APPLICATION_DATA, 1) => self.counts_early(record),
            // No implementation begins a second handshake on a connection; later epochs belong to one.
            _ => false,
        }
    }

    /// Counts what the library may keep until the handshake ends.
    fn counts_early(&mut self, record: &Record<'_>) -> bool {
        if self.established {
            return record.content != CHANGE_CIPHER_SPEC || counts(&mut self.early, EARLY);
        }
        self.early_bytes += record.body.len();
        self.early_bytes <= EARLY_BYTES && counts(&mut self.early, EARLY)
    }

    /// Handshake in clear: whole messages, and at its end perhaps a fragment of one. A fragment before the end the
    /// library would join with what follows it.
    fn admits_handshake(&mut self, body: &[u8]) -> bool {
        if self.handshake_bytes + body.len() > HANDSHAKE_BYTES {
            return false;
        }
        let mut rest = body;
        while !rest.is_empty() {
            let Some((header, after)) = rest.split_first_chunk::<FRAGMENT_HEADER>() else {
                return false;
            };
            let [_, l0, l1, l2, m0, m1, o0, o1, o2, f0, f1, f2] = *header;
            let [length, offset, part] = [[l0, l1, l2], [o0, o1, o2], [f0, f1, f2]]
                .map(|[a, b, c]| u32::from_be_bytes([0, a, b, c]) as usize);
            let message = usize::from(u16::from_be_bytes([m0, m1]));
            let Some(following) = after.get(part..) else {
                return false;
            };
            let is_whole = part == length;
            let fits = if is_whole {
                offset == 0
            } else {
                part > 0 && offset + part <= length && following.is_empty()
            };
            let is_counted = (self.fragments.get_mut(message))
                .is_some_and(|fragments| counts(fragments, FRAGMENTS));
            if !fits || !is_counted {
                return false;
            }
            rest = following;
        }
        self.handshake_bytes += body.len();
        true
    }
}

/// The first record of a datagram, and what is after it. The library knows the versions 1.0 and 1.2.
fn next(datagram: &[u8]) -> Option<(Record<'_>, &[u8])> {
    let (header, rest) = datagram.split_first_chunk::<HEADER>()?;
    let [content, 254, 255 | 253, e0, e1, .., l0, l1] = *header else {
        return None;
    };
    let (body, after) = rest.split_at_checked(usize::from(u16::from_be_bytes([l0, l1])))?;
    let record = Record {
        content,
        epoch: u16::from_be_bytes([e0, e1]),
        body,
    };
    (!body.is_empty()).then_some((record, after))
}

/// Counts one more; whether that is at most `most`.
fn counts(counter: &mut u8, most: u8) -> bool {
    *counter = counter.saturating_add(1);
    *counter <= most
}
