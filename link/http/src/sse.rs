//! Reads `text/event-stream` as the WHATWG specification says ("Interpreting an event stream"): any of CR, LF and CRLF ends a line,
//! wherever chunks are cut. `id` and `retry` are ignored: a new presence resumes nothing.
//!
//! Written here because the crates for it (sse-stream 0.3, eventsource-stream 0.2, sseer 0.3) hold a line or an event of any length in
//! memory; this one refuses what is longer than an offer can be.

use link_protocol::limits::MAX_SDP_BYTES;
use std::collections::VecDeque;

/// Bytes of a line: an SDP as JSON, whose escapes at most double it.
const MAX_LINE: usize = 2 * MAX_SDP_BYTES;
/// Bytes of an event's data.
const MAX_EVENT: usize = 4 * MAX_SDP_BYTES;

/// One event.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Event {
    /// Its type; `message` where the stream gives none.
    pub(crate) kind: String,
    /// Its data lines, joined by LF.
    pub(crate) data: String,
}

/// A line or an event is longer than any of the protocol's.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct TooLong;

/// The state between two chunks.
#[derive(Debug, Default)]
pub(crate) struct Parser {
    line: Vec<u8>,
    kind: String,
    data: String,
    /// The last byte was a CR: an LF now belongs to it.
    after_cr: bool,
    /// The first line, the only one that may begin with a byte order mark, is over.
    begun: bool,
}

impl Parser {
    /// Takes the next chunk; complete events go to `events`.
    pub(crate) fn push(
        &mut self,
        mut bytes: &[u8],
        events: &mut VecDeque<Event>,
    ) -> Result<(), TooLong> {
        if self.after_cr && !bytes.is_empty() {
            self.after_cr = false;
            bytes = bytes.strip_prefix(b"\n").unwrap_or(bytes);
        }
        while let Some(end) = bytes.iter().position(|byte| matches!(byte, b'\r' | b'\n')) {
            let (line, rest) = bytes.split_at(end);
            self.hold(line)?;
            bytes = match rest {
                [b'\r'] => {
                    self.after_cr = true;
                    &[]
                }
                [b'\r', b'\n', rest @ ..] | [_, rest @ ..] => rest,
                [] => &[],
            };
            self.end_line(events)?;
        }
        self.hold(bytes)
    }

    fn hold(&mut self, piece: &[u8]) -> Result<(), TooLong> {
        if self.line.len() + piece.len() > MAX_LINE {
            return Err(TooLong);
        }
        self.line.extend_from_slice(piece);
        Ok(())
    }

    fn end_line(&mut self, events: &mut VecDeque<Event>) -> Result<(), TooLong> {
        let mut line = self.line.as_slice();
        if !self.begun {
            self.begun = true;
            line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line);
        }
        if line.is_empty() {
            let kind = std::mem::take(&mut self.kind);
            let mut data = std::mem::take(&mut self.data);
            // Each data line added an LF: without one there was no data line.
            if data.pop().is_some() {
                events.push_back(Event {
                    kind: if kind.is_empty() {
                        "message".to_owned()
                    } else {
                        kind
                    },
                    data,
                });
            }
        } else {
            let text = String::from_utf8_lossy(line);
            let (field, value) = text.split_once(':').unwrap_or((&text, ""));
            let value = value.strip_prefix(' ').unwrap_or(value);
            match field {
                "event" => value.clone_into(&mut self.kind),
                "data" => {
                    if self.data.len() + value.len() > MAX_EVENT {
                        return Err(TooLong);
                    }
                    self.data.push_str(value);
                    self.data.push('\n');
                }
                // `id`, `retry`, what a later version may add, and comments, whose field is empty.
                _ => {}
            }
        }
        self.line.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(kind: &str, data: &str) -> Event {
        Event {
            kind: kind.to_owned(),
            data: data.to_owned(),
        }
    }

    fn read(pieces: &[&[u8]]) -> Vec<Event> {
        let (mut parser, mut events) = (Parser::default(), VecDeque::new());
        for piece in pieces {
            parser.push(piece, &mut events).expect("within bounds");
        }
        events.into()
    }

    /// A stream with every oddity of the specification, and what it means.
    fn odd() -> (Vec<u8>, Vec<Event>) {
        let stream = "\u{feff}data: first\n\n: a comment\r\nevent: offer\r\ndata: {\"a\":1,\rdata:\"b\": 2}\rid: 7\r\rdata\n\n\
                      data\ndata\n\nevent: lost without data\n\ndata:  two spaces\nretry: 10\nnonsense\nfoo: bar\n\n\
                      event: leave\ndata: \u{e4}\u{1f600}: x\r\n\r\n:\n\ndata: \u{feff}kept\n\ndata: never ended\n";
        let events = vec![
            event("message", "first"),
            event("offer", "{\"a\":1,\n\"b\": 2}"),
            event("message", ""),
            event("message", "\n"),
            event("message", " two spaces"),
            event("leave", "\u{e4}\u{1f600}: x"),
            event("message", "\u{feff}kept"),
        ];
        (stream.into(), events)
    }

    #[test]
    fn a_stream_means_the_same_wherever_it_is_cut() {
        let (stream, events) = odd();
        assert_eq!(read(&[&stream]), events, "in one piece");
        for cut in 0..=stream.len() {
            let (head, tail) = stream.split_at(cut);
            assert_eq!(read(&[head, tail]), events, "cut at {cut}");
            assert_eq!(
                read(&[head, &[], tail]),
                events,
                "cut at {cut}, with nothing in between"
            );
        }
        for size in 1..8 {
            assert_eq!(
                read(&stream.chunks(size).collect::<Vec<_>>()),
                events,
                "in pieces of {size}"
            );
        }
    }

    #[test]
    fn bytes_that_are_no_text_do_not_stop_the_stream() {
        let events = read(&[b"data: a\xffb\n\nevent: leave\ndata: c\n\n"]);
        assert_eq!(
            events,
            [event("message", "a\u{fffd}b"), event("leave", "c")],
            "a replacement character is in its place"
        );
    }

    #[test]
    fn an_endless_line_and_an_endless_event_are_refused() {
        let (mut parser, mut events) = (Parser::default(), VecDeque::new());
        let refused = (0..1000).find_map(|_| parser.push(&[b'x'; 1000], &mut events).err());
        assert_eq!(refused, Some(TooLong), "a line of a megabyte");
        assert!(parser.line.len() <= MAX_LINE, "what is held is bounded");
        let mut parser = Parser::default();
        let refused = (0..1000).find_map(|_| {
            parser
                .push(
                    &[b"data:".as_slice(), &[b'x'; 1000], b"\n"].concat(),
                    &mut events,
                )
                .err()
        });
        assert_eq!(refused, Some(TooLong), "an event of a megabyte");
    }
}
