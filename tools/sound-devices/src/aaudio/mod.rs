//! AAudio, which Android has since API level 26: each device has a thread of its own, which opens the stream, waits for it, and opens it again after it was lost.

mod device;
mod error;
mod loudspeaker;
mod microphone;

pub use error::SoundError;
pub use loudspeaker::Loudspeaker;
pub use microphone::Microphone;

/// Android's own audio service: there is one, and it is always there.
#[derive(Debug, Clone, Copy)]
pub struct SoundServer(());

impl SoundServer {
    /// The one there is.
    ///
    /// # Errors
    /// None.
    pub fn find() -> Result<Self, SoundError> {
        Ok(Self(()))
    }
}
