//! Bounds on the SCTP packets (RFC 9260) that DTLS carries, for the other side itself.
//!
//! Both channels of a call are negotiated, so nothing else is opened on a connection. The library would keep a channel,
//! or at least a stream, for each number that the other side names, an association for each that it begins, and every
//! chunk after a missing one.

use link_protocol::data_channel::{FEEDBACK_CHANNEL, MOTION_CHANNEL};

/// Chunks of data after the newest of which none before is missing. An honest side has 4,000 bytes on their way.
const WINDOW: i32 = 1_024;
/// The same before this side has acknowledged any.
const UNACKNOWLEDGED: u16 = 256;
/// Beginnings of an association, repetitions among them.
const BEGINNINGS: u8 = 16;
/// Resets of streams and responses to them (RFC 6525), repetitions among them. The library keeps each request, and
/// answers all of them after each chunk of data.
const RESETS: u8 = 32;

const COMMON_HEADER: usize = 12;
const CHUNK_HEADER: usize = 4;

const DATA: u8 = 0;
const INIT: u8 = 1;
const SACK: u8 = 3;
const RE_CONFIG: u8 = 130;
const FORWARD_TSN: u8 = 192;
/// The payload protocol of messages that open channels (RFC 8832).
const DCEP: u32 = 50;

/// The decision about a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    Passes,
    /// As if it were lost.
    Dropped,
    /// It is of no channel of a call.
    Foreign,
}

/// Counts of a connection's packets, and its newest acknowledgement.
#[derive(Debug, Default)]
pub(super) struct Association {
    /// This side has acknowledged all data up to this number.
    acknowledged: Option<u32>,
    unacknowledged: u16,
    beginnings: u8,
    resets: u8,
}

impl Association {
    /// This side sends a packet.
    pub(super) fn sends(&mut self, packet: &[u8]) {
        let mut rest = packet.get(COMMON_HEADER..).unwrap_or_default();
        while let Some((kind, body, after)) = next(rest) {
            if let (SACK, Some(number)) = (kind, number_at(body, 0)) {
                self.acknowledged = Some(number);
            }
            rest = after;
        }
    }

    /// The other side sends a packet.
    pub(super) fn verdict(&mut self, packet: &[u8]) -> Verdict {
        let mut rest = packet.get(COMMON_HEADER..).unwrap_or_default();
        while !rest.is_empty() {
            let Some((kind, body, after)) = next(rest) else {
                return Verdict::Dropped;
            };
            let verdict = match kind {
                DATA => self.verdict_of_data(body),
                INIT => within(&mut self.beginnings, BEGINNINGS),
                RE_CONFIG => within(&mut self.resets, RESETS),
                FORWARD_TSN => self.verdict_of_skip(body),
                _ => Verdict::Passes,
            };
            if verdict != Verdict::Passes {
                return verdict;
            }
            rest = after;
        }
        Verdict::Passes
    }

    fn verdict_of_data(&mut self, body: &[u8]) -> Verdict {
        let (Some(number), Some(&[high, low]), Some(protocol)) =
            (number_at(body, 0), body.get(4..6), number_at(body, 8))
        else {
            return Verdict::Dropped;
        };
        let stream = u16::from_be_bytes([high, low]);
        if protocol == DCEP || ![MOTION_CHANNEL.id, FEEDBACK_CHANNEL.id].contains(&stream) {
            return Verdict::Foreign;
        }
        let passes = match self.acknowledged {
            Some(acknowledged) => is_near(acknowledged, number),
            None => {
                self.unacknowledged = self.unacknowledged.saturating_add(1);
                self.unacknowledged <= UNACKNOWLEDGED
            }
        };
        Verdict::passes_if(passes)
    }

    /// The other side gives up its data up to a number, to which the library counts one by one. Before the first
    /// acknowledgement the packet counts as lost: the other side repeats it.
    fn verdict_of_skip(&self, body: &[u8]) -> Verdict {
        let numbers = self.acknowledged.zip(number_at(body, 0));
        Verdict::passes_if(
            numbers.is_some_and(|(acknowledged, number)| is_near(acknowledged, number)),
        )
    }
}

impl Verdict {
    fn passes_if(passes: bool) -> Self {
        if passes { Self::Passes } else { Self::Dropped }
    }
}

/// Whether a chunk's number is not far after the acknowledged one.
fn is_near(acknowledged: u32, number: u32) -> bool {
    number.wrapping_sub(acknowledged).cast_signed() <= WINDOW
}

/// Counts one more, of `most`.
fn within(count: &mut u8, most: u8) -> Verdict {
    *count = count.saturating_add(1);
    Verdict::passes_if(*count <= most)
}

/// The first chunk's kind and body, and what is after it and its padding.
fn next(chunks: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let &[kind, _, high, low] = chunks.first_chunk::<CHUNK_HEADER>()?;
    let length = usize::from(u16::from_be_bytes([high, low]));
    let body = chunks.get(CHUNK_HEADER..length)?;
    let after = chunks.get(length.next_multiple_of(4)..);
    Some((kind, body, after.unwrap_or_default()))
}

fn number_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_be_bytes(*bytes.get(at..)?.first_chunk()?))
}
