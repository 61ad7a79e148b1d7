//! PulseAudio's native protocol, which PipeWire speaks as well. No C library takes part.

mod connection;
mod device;
mod error;
mod loudspeaker;
mod microphone;
mod stream;

pub use connection::SoundServer;
pub use error::SoundError;
pub use loudspeaker::Loudspeaker;
pub use microphone::Microphone;
