//! The `paper` codec (kind 1): each frame by itself, FP16 and LZ4 as in the paper's section on communication.
//!
//! Bytes: kind, version, session u32, sequence u32, capture time u64, packing, body. The body is 215 FP16 numbers and the root
//! translation as three f32 (FP16 is 8 mm coarse at 10 m); packing 1 means that it is an LZ4 block. The numbers stand whole and in
//! order: in byte planes real motion takes a tenth more, because LZ4 then finds what repeats (a hand's joints turn about one
//! axis, what rests is zero) twice in halves instead of once (`cargo run -p link-codec --example codec_sizes` prints both).

use crate::decode_error::DecodeError;
use crate::{KIND_PAPER, limits};
use crate::{Micros, MotionFrame};
use glam::Vec3;
use half::f16;
use spmm3::{MotionParams, PARAMS};

const VERSION: u8 = 1;
const HEADER: usize = 19;
const STORED: u8 = 0;
const LZ4: u8 = 1;
/// Bytes of the body.
const BODY: usize = 2 * PARAMS + 12;
/// No LZ4 block of a body is longer and still worth sending.
pub(crate) const MAX_BYTES: usize = HEADER + BODY;

/// Writes a frame within the limits.
pub(crate) fn encode(session: u32, frame: &MotionFrame, out: &mut Vec<u8>) {
    out.extend([KIND_PAPER, VERSION]);
    out.extend(session.to_le_bytes());
    out.extend(frame.sequence.to_le_bytes());
    out.extend(frame.captured.0.to_le_bytes());
    let body = arrange(&frame.motion);
    // LZ4 asks for room for the worst case.
    let mut packed = [0; lz4_flex::block::get_maximum_output_size(BODY)];
    match lz4_flex::block::compress_into(&body, &mut packed) {
        Ok(length) if length < BODY => {
            out.push(LZ4);
            out.extend_from_slice(&packed[..length]);
        }
        _ => {
            out.push(STORED);
            out.extend_from_slice(&body);
        }
    }
}

/// Session and frame of a `paper` message.
pub(crate) fn decode(message: &[u8]) -> Result<(u32, MotionFrame), DecodeError> {
    if *message.get(1).ok_or(DecodeError::Length)? != VERSION {
        return Err(DecodeError::Version);
    }
    if message.len() > MAX_BYTES {
        return Err(DecodeError::Length);
    }
    let (header, body) = message
        .split_first_chunk::<HEADER>()
        .ok_or(DecodeError::Length)?;
    let [
        _,
        _,
        s0,
        s1,
        s2,
        s3,
        q0,
        q1,
        q2,
        q3,
        t0,
        t1,
        t2,
        t3,
        t4,
        t5,
        t6,
        t7,
        packing,
    ] = *header;
    let mut plain = [0; BODY];
    match packing {
        STORED => plain = body.try_into().map_err(|_| DecodeError::Length)?,
        LZ4 => match lz4_flex::block::decompress_into(body, &mut plain) {
            Ok(BODY) => {}
            _ => return Err(DecodeError::Lz4),
        },
        _ => return Err(DecodeError::Lz4),
    }
    let motion = restore(&plain);
    limits::check(&motion)?;
    let frame = MotionFrame {
        sequence: u32::from_le_bytes([q0, q1, q2, q3]),
        captured: Micros(u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7])),
        motion,
    };
    Ok((u32::from_le_bytes([s0, s1, s2, s3]), frame))
}

fn arrange(motion: &MotionParams) -> [u8; BODY] {
    let mut body = [0; BODY];
    let (values, translation) = body.split_at_mut(2 * PARAMS);
    for (out, value) in values.chunks_exact_mut(2).zip(motion.values()) {
        // Adding zero turns -0 into 0, so that whatever rests is all zero bytes.
        out.copy_from_slice(&(f16::from_f32(*value) + f16::ZERO).to_le_bytes());
    }
    let coordinates = motion.root_translation.to_array();
    for (out, value) in translation.chunks_exact_mut(4).zip(coordinates) {
        out.copy_from_slice(&value.to_le_bytes());
    }
    body
}

fn restore(body: &[u8; BODY]) -> MotionParams {
    let (values, translation) = body.split_at(2 * PARAMS);
    let values =
        std::array::from_fn(|i| f16::from_le_bytes([values[2 * i], values[2 * i + 1]]).to_f32());
    let coordinate = |i: usize| {
        let at = 4 * i;
        f32::from_le_bytes([
            translation[at],
            translation[at + 1],
            translation[at + 2],
            translation[at + 3],
        ])
    };
    let translation = Vec3::new(coordinate(0), coordinate(1), coordinate(2));
    MotionParams::new(values, translation)
}
