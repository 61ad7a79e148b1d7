//! The data channels and the messages on them beside motion frames: feedback, pong, bye (`docs/protocol.md`, "The data channels").

use link_codec::Micros;
use serde::Serialize;

/// The subprotocol of both channels.
pub const SUBPROTOCOL: &str = "mon3tr.1";

/// A data channel that both sides negotiated beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel {
    /// Its number.
    pub id: u16,
    /// Its label.
    pub label: &'static str,
}

/// From the sender to the viewer.
pub const MOTION_CHANNEL: Channel = Channel {
    id: 0,
    label: "motion",
};

/// From the viewer to the sender.
pub const FEEDBACK_CHANNEL: Channel = Channel {
    id: 1,
    label: "feedback",
};

/// The first byte of each message; those of motion frames are the codec's.
const FEEDBACK: u8 = 16;
const PONG: u8 = 17;
const STATE: u8 = 18;
const FORWARDED: u8 = 19;
const WATCHING: u8 = 22;
const BYE: u8 = 31;

/// A message that is no motion frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    /// A viewer reports what it has received.
    Feedback(Feedback),
    /// A sender answers a feedback that has a time.
    Pong(Pong),
    /// A sender tells whether it is heard and seen.
    State(State),
    /// Who forwards another sender's motion tells under which session that sender writes it; without this it is the viewer's own.
    Forwarded {
        /// The session that motion frames have from now on.
        of: u32,
    },
    /// Who forwards tells the sender to how many.
    Watching {
        /// Viewers connected now.
        viewers: u32,
    },
    /// The side that sends it leaves the call.
    Bye,
}

/// Whether a person in a call is heard and seen, as they chose.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct PersonState {
    /// Nothing is said: the microphone is off.
    pub muted: bool,
    /// No motion is sent: the person is not to be drawn.
    pub hidden: bool,
}

/// What a sender tells of itself, again and again, for one message may be lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct State {
    /// Whether it is heard and seen.
    pub person: PersonState,
    /// When this was sent, by the sender's clock: without motion nothing else tells its time, which voice needs.
    pub sent: Micros,
}

/// What a viewer has received so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Feedback {
    /// The newest sequence received; 0 before any.
    pub newest: u32,
    /// A bit for each of the 64 sequences before it, bit 0 the one just before.
    pub received: u64,
    /// When this was sent, by the viewer's clock; zero asks for no pong.
    pub sent: Micros,
}

/// The sender's answer to a feedback.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pong {
    /// The feedback's time, by the viewer's clock.
    pub asked: Micros,
    /// When the feedback arrived, by the sender's clock.
    pub arrived: Micros,
    /// When this was sent, by the sender's clock.
    pub left: Micros,
}

impl Message {
    /// Writes the message into `out`, which is cleared first.
    pub fn write(&self, session: u32, out: &mut Vec<u8>) {
        out.clear();
        out.push(match self {
            Self::Feedback(_) => FEEDBACK,
            Self::Pong(_) => PONG,
            Self::State(_) => STATE,
            Self::Forwarded { .. } => FORWARDED,
            Self::Watching { .. } => WATCHING,
            Self::Bye => BYE,
        });
        out.extend(session.to_le_bytes());
        match self {
            Self::Feedback(feedback) => {
                out.extend(feedback.newest.to_le_bytes());
                out.extend(feedback.received.to_le_bytes());
                out.extend(feedback.sent.0.to_le_bytes());
            }
            Self::Pong(pong) => {
                for time in [pong.asked, pong.arrived, pong.left] {
                    out.extend(time.0.to_le_bytes());
                }
            }
            Self::State(State { person, sent }) => {
                out.push(u8::from(person.muted) | u8::from(person.hidden) << 1);
                out.extend(sent.0.to_le_bytes());
            }
            Self::Forwarded { of } => out.extend(of.to_le_bytes()),
            Self::Watching { viewers } => out.extend(viewers.to_le_bytes()),
            Self::Bye => {}
        }
    }

    /// The session of a viewer's feedback: the sender learns it from the first one.
    pub fn session_of_feedback(bytes: &[u8]) -> Option<u32> {
        let session = bytes.get(1..5)?.try_into().ok().map(u32::from_le_bytes)?;
        let is_feedback = matches!(Self::read(bytes, session), Some(Self::Feedback(_)));
        is_feedback.then_some(session)
    }

    /// Reads a message of `session`; `None` for anything else.
    pub fn read(bytes: &[u8], session: u32) -> Option<Self> {
        let (kind, rest) = bytes.split_first()?;
        let (of, rest) = rest.split_first_chunk()?;
        if u32::from_le_bytes(*of) != session {
            return None;
        }
        let time = |bytes: &[u8; 8]| Micros(u64::from_le_bytes(*bytes));
        match *kind {
            FEEDBACK => {
                let (newest, rest) = rest.split_first_chunk()?;
                let (received, rest) = rest.split_first_chunk()?;
                Some(Self::Feedback(Feedback {
                    newest: u32::from_le_bytes(*newest),
                    received: u64::from_le_bytes(*received),
                    sent: time(rest.try_into().ok()?),
                }))
            }
            PONG => {
                let (asked, rest) = rest.split_first_chunk()?;
                let (arrived, rest) = rest.split_first_chunk()?;
                Some(Self::Pong(Pong {
                    asked: time(asked),
                    arrived: time(arrived),
                    left: time(rest.try_into().ok()?),
                }))
            }
            STATE => {
                // Bits of later versions are passed over.
                let (flags, rest) = rest.split_first()?;
                Some(Self::State(State {
                    person: PersonState {
                        muted: flags & 1 != 0,
                        hidden: flags & 2 != 0,
                    },
                    sent: time(rest.try_into().ok()?),
                }))
            }
            FORWARDED => Some(Self::Forwarded {
                of: u32::from_le_bytes(rest.try_into().ok()?),
            }),
            WATCHING => Some(Self::Watching {
                viewers: u32::from_le_bytes(rest.try_into().ok()?),
            }),
            BYE if rest.is_empty() => Some(Self::Bye),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Message; 6] = [
        Message::Feedback(Feedback {
            newest: 7,
            received: u64::MAX - 5,
            sent: Micros(1 << 50),
        }),
        Message::Pong(Pong {
            asked: Micros(1),
            arrived: Micros(2),
            left: Micros(u64::MAX),
        }),
        Message::State(State {
            person: PersonState {
                muted: false,
                hidden: true,
            },
            sent: Micros(1 << 40),
        }),
        Message::Forwarded { of: 0x0102_0304 },
        Message::Watching { viewers: 500 },
        Message::Bye,
    ];

    #[test]
    fn messages_are_read_as_written_only_whole_and_by_their_session() {
        let mut bytes = Vec::new();
        for message in ALL {
            message.write(0xdead_beef, &mut bytes);
            assert_eq!(Message::read(&bytes, 0xdead_beef), Some(message), "whole");
            assert_eq!(Message::read(&bytes, 1), None, "a foreign session");
            let feedback = matches!(message, Message::Feedback(_));
            let session = Message::session_of_feedback(&bytes);
            assert_eq!(
                session,
                feedback.then_some(0xdead_beef),
                "{message:?} tells it"
            );
            for length in 0..bytes.len() {
                assert_eq!(
                    Message::read(&bytes[..length], 0xdead_beef),
                    None,
                    "{length} bytes of {message:?}"
                );
            }
            bytes.push(0);
            assert_eq!(Message::read(&bytes, 0xdead_beef), None, "a byte too many");
        }
    }

    #[test]
    fn the_layout_is_the_protocols() {
        let mut bytes = Vec::new();
        ALL[0].write(0x0403_0201, &mut bytes);
        let expected = [
            &[16, 1, 2, 3, 4, 7, 0, 0, 0, 0xfa][..],
            &[0xff; 7],
            &[0, 0, 0, 0, 0, 0, 4, 0],
        ]
        .concat();
        assert_eq!(bytes, expected, "a feedback");
    }
}
