//! The motion codec: a [`MotionFrame`] to the bytes of one data-channel message and back, for one viewer's session.
//!
//! `paper` is FP16 + LZ4 as in the paper, each frame by itself. `compact` is an integer grid, predicted from frames that the
//! viewer has acknowledged and range coded. A [`Decoder`] trusts nothing: what it refuses leaves it as it was.
//! Nothing here keeps time, sorts frames or talks to a network.

mod compact;
mod forecast;
mod frame;
mod grid;
pub mod limits;
mod paper;
pub mod refusal;
mod residual;
mod window;

pub use frame::{Micros, MotionFrame};

use compact::{FURTHEST_BACK, Reference};
use grid::{Grid, VALUES};
use refusal::{Refusal, RefusalCounts};
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};
use window::{WINDOW, Window};

const KIND_PAPER: u8 = 1;
const KIND_COMPACT: u8 = 2;

/// How motion is written. A viewer reads either.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Codec {
    /// The paper's: FP16 and LZ4, each frame by itself. A rotation and each component of its shortest vector is
    /// within 0.1 degree, the root within 0.1 mm, a coefficient within 1/4096 of its range -8..=8.
    Paper,
    /// A third to a seventh of the paper's size. A rotation and each component of its shortest vector is within 0.5 degree (finger tips;
    /// the spine, hips and shoulders within 0.1), the root within 0.5 mm, a coefficient within 1/1024 of its range -8..=8.
    #[default]
    Compact,
}

impl fmt::Display for Codec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Paper => "paper",
            Self::Compact => "compact",
        })
    }
}

/// A codec's name was neither `paper` nor `compact`.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no codec `{0}`: say `paper` or `compact`")]
pub struct UnknownCodec(String);

impl FromStr for Codec {
    type Err = UnknownCodec;

    fn from_str(name: &str) -> Result<Self, UnknownCodec> {
        match name {
            "paper" => Ok(Self::Paper),
            "compact" => Ok(Self::Compact),
            _ => Err(UnknownCodec(name.to_owned())),
        }
    }
}

#[derive(Debug, Clone)]
struct Sent {
    sequence: u32,
    captured: Micros,
    acknowledged: bool,
    grid: Grid,
}

/// Writes one viewer's frames.
#[derive(Debug)]
pub struct Encoder {
    codec: Codec,
    session: u32,
    /// The last frames, each at its sequence modulo their number.
    sent: Vec<Sent>,
    newest_acknowledged: u32,
    mended: u64,
    frame: MotionFrame,
}

impl Encoder {
    /// An encoder for one session.
    #[must_use]
    pub fn new(codec: Codec, session: u32) -> Self {
        let none = Sent {
            sequence: 0,
            captured: Micros(0),
            acknowledged: false,
            grid: [0; VALUES],
        };
        Self {
            codec,
            session,
            sent: vec![none; WINDOW as usize],
            newest_acknowledged: 0,
            mended: 0,
            frame: MotionFrame::default(),
        }
    }

    /// Replaces `out` by the message of `frame`, kind and all. Sequences begin at 1 and must grow.
    ///
    /// What is no number or out of range is sent as rest or as the nearest in range, and counted ([`Self::mended`]).
    /// Allocates nothing once `out` has grown to its size.
    pub fn encode(&mut self, frame: &MotionFrame, out: &mut Vec<u8>) {
        out.clear();
        let (motion, mended) = limits::mend(&frame.motion);
        self.mended += mended;
        self.frame = MotionFrame { motion, ..*frame };
        match self.codec {
            Codec::Paper => paper::encode(self.session, &self.frame, out),
            Codec::Compact => {
                let reference = self.reference(frame.sequence);
                let get = |sequence| self.acknowledged(sequence);
                let grid = compact::encode(self.session, &self.frame, reference, get, out);
                let at = frame.sequence as usize % self.sent.len();
                self.sent[at] = Sent {
                    sequence: frame.sequence,
                    captured: frame.captured,
                    acknowledged: false,
                    grid,
                };
            }
        }
    }

    /// Learns from a viewer's feedback which frames it has: the newest, and a bit for each of the 64 before it (bit 0: the one
    /// just before).
    pub fn acknowledge(&mut self, newest: u32, received: u64) {
        let before = (0..WINDOW)
            .filter(|bit| received >> bit & 1 == 1)
            .map(|bit| bit + 1);
        for back in std::iter::once(0).chain(before) {
            let Some(sequence) = newest.checked_sub(back) else {
                break;
            };
            let at = sequence as usize % self.sent.len();
            let sent = &mut self.sent[at];
            if sequence != 0 && sent.sequence == sequence {
                sent.acknowledged = true;
                self.newest_acknowledged = self.newest_acknowledged.max(sequence);
            }
        }
    }

    /// How many values were not numbers or out of range so far.
    #[must_use]
    pub fn mended(&self) -> u64 {
        self.mended
    }

    fn acknowledged(&self, sequence: u32) -> Option<(Micros, &Grid)> {
        let sent = &self.sent[sequence as usize % self.sent.len()];
        (sent.acknowledged && sent.sequence == sequence).then_some((sent.captured, &sent.grid))
    }

    /// What to predict a frame from: the newest frame that the viewer has, and three older ones, each about as far before the next as the
    /// frame is after the newest.
    fn reference(&self, sequence: u32) -> Option<Reference> {
        let newest = self.newest_acknowledged;
        let back = sequence
            .checked_sub(newest)
            .filter(|back| (1..=FURTHEST_BACK).contains(back))?;
        self.acknowledged(newest)?;
        let all_there = |spacing: u32| {
            (1..=3).all(|n| {
                newest
                    .checked_sub(n * spacing)
                    .is_some_and(|s| self.acknowledged(s).is_some())
            })
        };
        let spacing = (1..=(FURTHEST_BACK - back) / 3)
            .filter(|spacing| all_there(*spacing))
            .min_by_key(|spacing| spacing.abs_diff(back));
        let byte = |n: u32| u8::try_from(n).ok();
        Some(Reference {
            back: byte(back)?,
            spacing: byte(spacing.unwrap_or(0))?,
        })
    }
}

/// Reads one session's messages.
#[derive(Debug)]
pub struct Decoder {
    session: u32,
    window: Window,
    refusals: RefusalCounts,
}

impl Decoder {
    /// A decoder for one session.
    #[must_use]
    pub fn new(session: u32) -> Self {
        Self {
            session,
            window: Window::new(),
            refusals: RefusalCounts::default(),
        }
    }

    /// The frame of a message, whichever codec wrote it. Frames may come in any order within the window of 64.
    ///
    /// # Errors
    /// The reason why the message is not to be shown; it is counted.
    pub fn decode(&mut self, message: &[u8]) -> Result<MotionFrame, Refusal> {
        self.read(message)
            .inspect_err(|refusal| self.refusals.add(*refusal))
    }

    fn read(&mut self, message: &[u8]) -> Result<MotionFrame, Refusal> {
        match message.first() {
            None => Err(Refusal::Length),
            Some(&KIND_PAPER) => {
                let (session, frame) = paper::decode(message)?;
                if session != self.session {
                    return Err(Refusal::ForeignSession);
                }
                self.window.admit(frame.sequence, frame.captured)?;
                self.window.insert(frame.sequence, frame.captured, None);
                Ok(frame)
            }
            Some(&KIND_COMPACT) => {
                let (frame, grid) = compact::decode(self.session, message, &self.window)?;
                self.window
                    .insert(frame.sequence, frame.captured, Some(&grid));
                Ok(frame)
            }
            Some(_) => Err(Refusal::Kind),
        }
    }

    /// What was refused so far.
    #[must_use]
    pub fn refusals(&self) -> &RefusalCounts {
        &self.refusals
    }

    /// What to say in feedback: the newest sequence (0 before any), and a bit for each of the 64 frames before it, bit 0 for the one just
    /// before.
    #[must_use]
    pub fn feedback(&self) -> (u32, u64) {
        (self.window.newest(), self.window.received())
    }
}
