//! The motion codec: a [`MotionFrame`] to the bytes of one message and back, for one viewer's session (`docs/protocol.md`).
//!
//! [`Codec::Paper`] is FP16 and LZ4 as in the paper, each frame by itself. [`Codec::Compact`] is an integer grid, predicted from frames
//! that the viewer has acknowledged, and range coded. A [`Decoder`] reads both and trusts nothing. The crate keeps no time, does not
//! sort frames and does not talk to a network.
//!
//! ```
//! use link_codec::{Codec, Decoder, Encoder, Micros, MotionFrame};
//! use spmm3::{Joint, MotionParams};
//!
//! let mut motion = MotionParams::default();
//! motion.set_axis_angle(Joint::LeftElbow, glam::Vec3::new(0.0, -0.8, 0.0));
//!
//! // Both sides know the session's number; each viewer has a session of its own.
//! let (mut encoder, mut decoder) = (Encoder::new(Codec::Compact, 7), Decoder::new(7));
//! let mut message = Vec::new();
//! for sequence in 1..=3 {
//!     let captured = Micros(33_333 * u64::from(sequence));
//!     encoder.encode(&MotionFrame { sequence, captured, motion: motion.clone() }, &mut message);
//!     let frame = decoder.decode(&message)?;
//!     let elbow = frame.motion.axis_angle(Joint::LeftElbow);
//!     assert!((elbow.y + 0.8).abs() < 0.01, "within half a degree: {elbow}");
//!     println!("frame {sequence}: {} bytes", message.len());
//!     // The viewer's feedback lets the next frame be predicted from this one.
//!     let (newest, received) = decoder.feedback();
//!     encoder.acknowledge(newest, received);
//! }
//! # Ok::<(), link_codec::decode_error::DecodeError>(())
//! ```

#![forbid(unsafe_code)]

mod codec;
mod compact;
pub mod decode_error;
mod decoder;
mod encoder;
mod frame;
mod grid;
pub mod limits;
mod paper;
mod prediction;
mod residual;
mod window;

pub use codec::{Codec, UnknownCodec};
pub use decoder::Decoder;
pub use encoder::Encoder;
pub use frame::{Micros, MotionFrame};

/// The first byte of a message of each codec.
const KIND_PAPER: u8 = 1;
const KIND_COMPACT: u8 = 2;
