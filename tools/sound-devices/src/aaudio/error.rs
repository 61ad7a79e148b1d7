//! Why there is no sound.

use ndk::audio::AudioError;

/// Why a device cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SoundError {
    /// Android does not open it.
    #[error("Android does not open the {kind}")]
    Closed {
        /// Microphone or loudspeaker.
        kind: &'static str,
        /// Why not.
        source: AudioError,
    },
    /// Android has no device of a name.
    #[error("Android chooses the {kind} itself, and {name} was asked for")]
    Named {
        /// Microphone or loudspeaker.
        kind: &'static str,
        /// What was asked for.
        name: String,
    },
    /// Android opened it with another format than was asked for.
    #[error("Android opens the {kind} with {channels} channels of {rate_hz} Hz")]
    Format {
        /// Microphone or loudspeaker.
        kind: &'static str,
        /// How many.
        channels: i32,
        /// Of each, samples a second.
        rate_hz: i32,
    },
    /// Android has taken the device away.
    #[error("Android has taken it away")]
    TakenAway(#[source] AudioError),
    /// The device does nothing.
    #[error("it has done nothing for seconds")]
    Slow,
    /// There is no thread for it.
    #[error("there is no thread for it")]
    Thread(#[source] std::io::Error),
    /// Its thread has failed.
    #[error("its thread has failed")]
    Failed,
}
