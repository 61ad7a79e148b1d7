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

const COMMON_HEADER: usize = 12;
const CHUNK_HEADER: usize = 4;

const DATA: u8 = 0;
const INIT: u8 = 1;
const SACK: u8 = 3;
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
                INIT => {
                    self.beginnings = self.beginnings.saturating_add(1);
                    if self.beginnings > BEGINNINGS {
                        Verdict::Dropped
                    } else {
                        Verdict::Passes
                    }
                }
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
        let is_near = match self.acknowledged {
            Some(acknowledged) => number.wrapping_sub(acknowledged).cast_signed() <= WINDOW,
            None => {
                self.unacknowledged = self.unacknowledged.saturating_add(1);
                self.unacknowledged <= UNACKNOWLEDGED
            }
        };
        if is_near {
            Verdict::Passes
        } else {
            Verdict::Dropped
        }
    }
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
