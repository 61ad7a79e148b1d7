//! The sending side: one viewer's frames as messages, predicted from frames that this viewer has acknowledged.

use crate::compact::{self, MAX_BACK, Reference};
use crate::grid::{Grid, VALUES};
use crate::window::WINDOW;
use crate::{Codec, Micros, MotionFrame, limits, paper};

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
    corrected: u64,
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
            corrected: 0,
            frame: MotionFrame::default(),
        }
    }

    /// Replaces `out` by the message of `frame`, kind and all. Sequences begin at 1 and must grow.
    ///
    /// NaN is sent as rest, a value out of range as the nearest one in range; both are counted ([`Self::corrected`]).
    /// Allocates nothing once `out` has grown to its size.
    pub fn encode(&mut self, frame: &MotionFrame, out: &mut Vec<u8>) {
        out.clear();
        let (motion, corrected) = limits::correct(&frame.motion);
        self.corrected += corrected;
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
    pub fn corrected(&self) -> u64 {
        self.corrected
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
            .filter(|back| (1..=MAX_BACK).contains(back))?;
        self.acknowledged(newest)?;
        let all_there = |spacing: u32| {
            (1..=3).all(|n| {
                newest
                    .checked_sub(n * spacing)
                    .is_some_and(|s| self.acknowledged(s).is_some())
            })
        };
        let spacing = (1..=(MAX_BACK - back) / 3)
            .filter(|spacing| all_there(*spacing))
            .min_by_key(|spacing| spacing.abs_diff(back));
        let byte = |n: u32| u8::try_from(n).ok();
        Some(Reference {
            back: byte(back)?,
            spacing: byte(spacing.unwrap_or(0))?,
        })
    }
}
