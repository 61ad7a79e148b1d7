//! What a microphone heard, as it should be sent: without the echo of the loudspeaker beside it, without steady noise, and at the level of
//! other voices. [`VoiceProcessor`] is the microphone's side; [`FarEnd`] is told what the loudspeaker plays, by whatever thread plays it.
//!
//! The algorithms are those of WebRTC's audio processing module, in Rust (`sonora`): a high-pass filter, echo canceller AEC3, noise suppression
//! and gain controller AGC2 with its limiter. What is added here is the alignment: microphone and loudspeaker are two devices with two
//! clocks, and both tell when their samples were in the air.
//!
//! Everything is one channel of 48 kHz, samples from -1 to 1.

#![forbid(unsafe_code)]

mod alignment;
mod far_end;
mod loud;
mod processor;

pub use far_end::FarEnd;
pub use processor::{DELAY, FRAME, VoiceProcessor};

/// Samples a second.
pub const RATE: u32 = 48_000;
/// Samples of a piece, 10 ms: what is played and processed at a time.
pub const PIECE: usize = 480;
