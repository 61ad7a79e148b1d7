//! The microphone and the loudspeaker of a machine, by PulseAudio's native protocol, which PipeWire speaks as well: [`Microphone`] and
//! [`Loudspeaker`]. Both come back by themselves after their device or its server was away. No C library takes part.
//!
//! Everything is one channel of 48 kHz, samples from -1 to 1; the server converts what a device has otherwise.

mod clock;
mod connection;
mod device;
mod error;
mod loudspeaker;
mod microphone;
mod stream;

pub use connection::SoundServer;
pub use error::SoundError;
pub use loudspeaker::{Fill, Loudspeaker};
pub use microphone::Microphone;

/// Samples a second.
pub const RATE: u32 = 48_000;
