//! What can stop a sender.

use link_call::CallError;
use link_voice::{RATE, VoiceError};
use std::path::PathBuf;

/// An error on the sending side.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SendError {
    /// The server or the network.
    #[error(transparent)]
    Link(#[from] CallError),
    /// The store lacks the avatar and there is no token to upload it.
    #[error(
        "the server has no package {} of the room's owner yet, and only that owner may put it there: give the owner's token too (or the link \
         is the viewers', where the sender's is needed)",
        .0.display()
    )]
    NotUploaded(PathBuf),
    /// The source of motion failed, as it says itself.
    #[error(transparent)]
    Capture(Box<dyn std::error::Error + Send + Sync>),
    /// The file of a voice cannot be read.
    #[error("{} is no voice to send", path.display())]
    VoiceFile {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: hound::Error,
    },
    /// The file of a voice has another format.
    #[error(
        "{} is no voice to send: it has {samples} samples of {rate_hz} Hz in {channels} channels, and voice has {RATE} Hz and one channel or two: \
         ffmpeg -i FILE -ar {RATE} -ac 1 voice.wav makes it so",
        path.display()
    )]
    VoiceFormat {
        /// The file.
        path: PathBuf,
        /// Of each channel.
        samples: u32,
        /// Samples a second.
        rate_hz: u32,
        /// How many there are.
        channels: u16,
    },
    /// The voice cannot be encoded.
    #[error(transparent)]
    Voice(#[from] VoiceError),
}
