//! What a sender writes so that a forwarder can hand it on and not read it (`docs/protocol.md`, "Sealed"): the frame
//! around sealed bytes, the lines that show who seals, and those by which keys are agreed on. The cryptography is the
//! call's.

use crate::refusal::REFUSAL_LINE;
use crate::sdp::with_session_lines;

/// How the line begins by which the sender and a viewer that it hands over agree on a key: of the viewer's offer, and of
/// the sender's answer.
pub const EXCHANGE_LINE: &str = "a=mon3tr-exchange:";

/// How all lines begin that a sender adds to its answer.
const ADDED: &str = "a=mon3tr-";

/// The first byte of each message.
const SEALED: u8 = 20;
const SEAL: u8 = 21;

/// Bytes of [`Header`].
const HEADER_BYTES: usize = 9;

/// Bytes of the tag of ChaCha20-Poly1305 (RFC 8439).
pub const TAG_BYTES: usize = 16;

/// The longest lines of a seal, bytes.
const MAX_LINES: usize = 1024;

/// What stands before a sealed message, for everyone to read; the tag is of it, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// The session under which the sender writes.
    pub session: u32,
    /// Of no two messages of the session the same.
    pub counter: u32,
}

impl Header {
    /// As it stands in the message.
    #[must_use]
    pub fn bytes(self) -> [u8; HEADER_BYTES] {
        let mut bytes = [SEALED; HEADER_BYTES];
        bytes[1..5].copy_from_slice(&self.session.to_le_bytes());
        bytes[5..].copy_from_slice(&self.counter.to_le_bytes());
        bytes
    }

    /// The header of a sealed message, and what follows it; `None` for any other message.
    #[must_use]
    pub fn read(message: &[u8]) -> Option<(Self, &[u8])> {
        let (kind, rest) = message.split_first()?;
        let (session, rest) = rest.split_first_chunk()?;
        let (counter, rest) = rest.split_first_chunk()?;
        (*kind == SEALED && rest.len() >= TAG_BYTES).then(|| {
            let header = Self {
                session: u32::from_le_bytes(*session),
                counter: u32::from_le_bytes(*counter),
            };
            (header, rest)
        })
    }
}

/// The forwarder's answer with what the sender shows of itself and of the keys in its own `refusal`.
#[must_use]
pub fn with_exchange(answer: &str, refusal: &str) -> String {
    let is_copied = |line: &&str| line.starts_with(ADDED) && !line.starts_with(REFUSAL_LINE);
    let copied = refusal.lines().filter(is_copied);
    let copied: String = copied
        .map(|line| format!("{}\r\n", line.trim_end()))
        .collect();
    with_session_lines(answer, &[&copied])
}

/// Writes the lines of a seal, for the other side's `session`, into `out`, which is cleared first.
pub fn write_seal(session: u32, lines: &str, out: &mut Vec<u8>) {
    out.clear();
    out.push(SEAL);
    out.extend(session.to_le_bytes());
    out.extend(lines.as_bytes());
}

/// The lines of a seal; `None` for any other message.
#[must_use]
pub fn read_seal(message: &[u8], session: u32) -> Option<&str> {
    let (kind, rest) = message.split_first()?;
    let (of, lines) = rest.split_first_chunk()?;
    let is_seal = *kind == SEAL && u32::from_le_bytes(*of) == session && lines.len() <= MAX_LINES;
    is_seal.then(|| std::str::from_utf8(lines).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sealed_message_is_read_as_it_is_written_and_never_cut_short() {
        let header = Header {
            session: 0x0403_0201,
            counter: 0x0807_0605,
        };
        let mut message = header.bytes().to_vec();
        assert_eq!(message, [20, 1, 2, 3, 4, 5, 6, 7, 8]);
        message.extend([9; TAG_BYTES]);
        assert_eq!(Header::read(&message), Some((header, &[9; TAG_BYTES][..])));
        for length in 0..message.len() {
            assert_eq!(Header::read(&message[..length]), None, "{length} bytes");
        }
        message[0] = 19;
        assert_eq!(Header::read(&message), None, "another kind");
    }

    #[test]
    fn a_forwarders_answer_gets_the_senders_lines_before_its_media() {
        let answer = "v=0\r\na=mon3tr-forwarder\r\nm=application 9\r\n";
        let refusal = "v=0\r\na=mon3tr-refused:full\r\na=mon3tr-exchange:a 1 b\r\na=other:c\r\na=mon3tr-link:d\r\n";
        let expected = "v=0\r\na=mon3tr-forwarder\r\na=mon3tr-exchange:a 1 b\r\na=mon3tr-link:d\r\nm=application 9\r\n";
        assert_eq!(with_exchange(answer, refusal), expected);
        assert_eq!(with_exchange(answer, "v=0\r\n"), answer);
    }

    #[test]
    fn a_seal_is_for_one_session_bounded_and_text() {
        let mut message = Vec::new();
        write_seal(7, "a=mon3tr-seal:x 1\r\n", &mut message);
        assert_eq!(read_seal(&message, 7), Some("a=mon3tr-seal:x 1\r\n"));
        assert_eq!(read_seal(&message, 8), None, "a foreign session");
        assert_eq!(read_seal(&message[..4], 7), None, "cut short");
        write_seal(7, &"x".repeat(MAX_LINES + 1), &mut message);
        assert_eq!(read_seal(&message, 7), None, "too long");
        assert_eq!(read_seal(&[21, 7, 0, 0, 0, 0xff], 7), None, "no text");
    }
}
