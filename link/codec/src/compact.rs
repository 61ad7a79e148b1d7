//! The `compact` codec (kind 2): a frame on the integer grid, predicted from frames that the viewer has acknowledged, so that
//! the loss of a frame spoils no later one.
//!
//! Bytes: kind; session's check u8; u16 of version (4 bits), distance back to the newest reference (6), spacing of the three
//! older ones (6); check u16 over session, sequence, time and grid. With a reference: the sequence's low byte; without (a key
//! frame): sequence u32 and capture time u64. Then the range coder's words: with a reference the capture time's residual first.

use crate::KIND_COMPACT;
use crate::decode_error::DecodeError;
use crate::grid::{self, Grid, VALUES};
use crate::prediction::{ReferenceFrames, code_values};
use crate::residual::{Coder, Reader, Writer};
use crate::window::Window;
use crate::{Micros, MotionFrame};

const VERSION: u16 = 1;
/// Distances have six bits.
pub(crate) const MAX_BACK: u32 = 63;
/// More than twice what a key frame of the widest values takes.
const MAX_BYTES: usize = 1100;
/// A capture time further from its prediction than this, microseconds, is sent in a key frame.
const MAX_TIME_RESIDUAL: u64 = 1 << 40;

/// Which frames a frame is predicted from, as the header says it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Reference {
    /// Frames back to the newest; 1..=63.
    pub(crate) back: u8,
    /// Frames between the newest and three older ones; 0: there are none.
    pub(crate) spacing: u8,
}

/// A reference with its frames looked up; both sides find the same.
struct Resolved<'a> {
    references: ReferenceFrames<'a>,
    /// The predicted capture time, microseconds.
    captured: u64,
}

impl Reference {
    fn find<'a>(
        self,
        sequence: u32,
        get: impl Fn(u32) -> Option<(Micros, &'a Grid)>,
    ) -> Option<Resolved<'a>> {
        let newest_at = sequence.checked_sub(u32::from(self.back))?;
        let (newest_time, newest) = get(newest_at)?;
        let older = if self.spacing == 0 {
            None
        } else {
            let older = |n: u32| get(newest_at.checked_sub(n * u32::from(self.spacing))?);
            Some([older(1)?, older(2)?, older(3)?])
        };
        // The capture times go on at the rate of the reference frames.
        let passed = older.map_or(0, |older| {
            newest_time.0.wrapping_sub(older[2].0.0) / (3 * u64::from(self.spacing))
        });
        Some(Resolved {
            references: ReferenceFrames {
                newest,
                ahead: self.back,
                older: older.map(|older| (older.map(|(_, grid)| grid), self.spacing)),
            },
            captured: newest_time
                .0
                .wrapping_add(passed.wrapping_mul(u64::from(self.back))),
        })
    }
}

/// Writes a frame within the limits and returns its grid. `get` knows the frames the viewer has; the reference, if any, is among
/// them.
pub(crate) fn encode<'a>(
    session: u32,
    frame: &MotionFrame,
    reference: Option<Reference>,
    get: impl Fn(u32) -> Option<(Micros, &'a Grid)>,
    out: &mut Vec<u8>,
) -> Grid {
    let resolved = reference.and_then(|r| Some((r, r.find(frame.sequence, get)?)));
    let resolved = resolved.filter(|(_, resolved)| {
        time_residual(frame.captured.0, resolved.captured) < MAX_TIME_RESIDUAL
    });
    let references = resolved.as_ref().map(|(_, resolved)| resolved.references);
    let mut grid = grid::quantise(
        &frame.motion,
        references.map(|references| references.newest),
    );
    let (back, spacing) = resolved
        .as_ref()
        .map_or((0, 0), |(r, _)| (r.back, r.spacing));
    let about = VERSION << 12 | u16::from(back) << 6 | u16::from(spacing);
    out.extend([KIND_COMPACT, session_check(session)]);
    out.extend(about.to_le_bytes());
    out.extend(check(session, frame.sequence, frame.captured, &grid).to_le_bytes());
    let [low, ..] = frame.sequence.to_le_bytes();
    if resolved.is_some() {
        out.push(low);
    } else {
        out.extend(frame.sequence.to_le_bytes());
        out.extend(frame.captured.0.to_le_bytes());
    }
    let mut writer = Writer::new(out);
    let mut write = || {
        if let Some((_, resolved)) = &resolved {
            writer.wide(time_residual(frame.captured.0, resolved.captured))?;
        }
        code_values(&mut writer, references, &mut grid)
    };
    // Only reading can fail.
    let _: Result<(), DecodeError> = write();
    writer.finish();
    grid
}

/// Reads a `compact` message, with the frames that arrived before it.
pub(crate) fn decode(
    session: u32,
    message: &[u8],
    window: &Window,
) -> Result<(MotionFrame, Grid), DecodeError> {
    let ([_, for_session, a0, a1, c0, c1], rest) =
        message.split_first_chunk().ok_or(DecodeError::Length)?;
    let about = u16::from_le_bytes([*a0, *a1]);
    if about >> 12 != VERSION {
        return Err(DecodeError::Version);
    }
    if message.len() > MAX_BYTES || message.last() == Some(&0) {
        return Err(DecodeError::Length);
    }
    if *for_session != session_check(session) {
        return Err(DecodeError::ForeignSession);
    }
    let [back, spacing] = [about >> 6, about].map(|bits| (bits & 63).to_le_bytes()[0]);
    let mut grid = [0; VALUES];
    let (sequence, captured, mut reader, references);
    if back == 0 {
        let (s, rest) = rest.split_first_chunk().ok_or(DecodeError::Length)?;
        let (t, rest) = rest.split_first_chunk().ok_or(DecodeError::Length)?;
        (sequence, captured) = (u32::from_le_bytes(*s), Micros(u64::from_le_bytes(*t)));
        (reader, references) = (Reader::new(rest), None);
    } else {
        let ([low], rest) = rest.split_first_chunk().ok_or(DecodeError::Length)?;
        sequence = nearest(window.newest(), *low);
        let resolved = Reference { back, spacing }
            .find(sequence, |sequence| window.get(sequence))
            .ok_or(DecodeError::Reference)?;
        reader = Reader::new(rest);
        captured = Micros(time_from_residual(resolved.captured, reader.wide(0)?));
        references = Some(resolved.references);
    }
    window.admit(sequence, captured)?;
    code_values(&mut reader, references, &mut grid)?;
    reader.finish()?;
    if [*c0, *c1] != check(session, sequence, captured, &grid).to_le_bytes() {
        return Err(DecodeError::Corrupt);
    }
    let motion = grid::restore(&grid)?;
    Ok((
        MotionFrame {
            sequence,
            captured,
            motion,
        },
        grid,
    ))
}

/// The sequence with this low byte that is nearest to `newest`.
fn nearest(newest: u32, low: u8) -> u32 {
    let [newest_low, ..] = newest.to_le_bytes();
    newest.wrapping_add_signed(i32::from(low.wrapping_sub(newest_low).cast_signed()))
}

/// Zigzag coding: a signed difference with the sign in the lowest bit, so that small ones are small numbers.
fn time_residual(captured: u64, predicted: u64) -> u64 {
    let residual = captured.wrapping_sub(predicted).cast_signed();
    (residual << 1 ^ residual >> 63).cast_unsigned()
}

fn time_from_residual(predicted: u64, residual: u64) -> u64 {
    predicted.wrapping_add(residual >> 1 ^ (residual & 1).wrapping_neg())
}

fn session_check(session: u32) -> u8 {
    session.wrapping_mul(0x9e37_79b1).to_be_bytes()[0]
}

/// Sixteen bits (FNV-1a over words, folded) over session, sequence, capture time and grid.
fn check(session: u32, sequence: u32, captured: Micros, grid: &Grid) -> u16 {
    let mix = |hash: u32, word: u32| (hash ^ word).wrapping_mul(0x0100_0193).rotate_left(5);
    let [t0, t1, t2, t3, t4, t5, t6, t7] = captured.0.to_le_bytes();
    let head = [
        session,
        sequence,
        u32::from_le_bytes([t0, t1, t2, t3]),
        u32::from_le_bytes([t4, t5, t6, t7]),
    ];
    let hash = head
        .into_iter()
        .chain(grid.iter().map(|v| v.cast_unsigned()))
        .fold(0x811c_9dc5, mix);
    let [a, b, c, d] = hash.to_le_bytes();
    u16::from_le_bytes([a ^ c, b ^ d])
}
