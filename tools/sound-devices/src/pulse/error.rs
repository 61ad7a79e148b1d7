//! Why there is no sound.

use pulseaudio::protocol::{ProtocolError, PulseError};
use std::path::PathBuf;

/// Why a device cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SoundError {
    /// There is no server's socket.
    #[error(
        "no sound server runs here: start PulseAudio, or PipeWire with pipewire-pulse (its socket is looked for in $PULSE_SERVER, \
         $PULSE_RUNTIME_PATH/pulse/native and $XDG_RUNTIME_DIR/pulse/native)"
    )]
    NoServer,
    /// The server's socket does not answer.
    #[error("the sound server at {} does not answer", path.display())]
    Unreachable {
        /// The socket.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The server has no such device.
    #[error(
        "the sound server has no {kind} of the name {name}; it has {}",
        or_none(others)
    )]
    NoSuchDevice {
        /// Microphone or loudspeaker.
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// What there is.
        others: Vec<String>,
    },
    /// The server has no device at all, but what is heard on its loudspeakers.
    #[error(
        "the sound server has no {kind}: connect one, or name one of {}",
        or_none(others)
    )]
    NoDevice {
        /// Microphone or loudspeaker.
        kind: &'static str,
        /// What else there is.
        others: Vec<String>,
    },
    /// The server has taken the device away.
    #[error("the sound server has taken it away")]
    TakenAway,
    /// The server has closed the connection.
    #[error("the sound server has ended")]
    Ended,
    /// The server does not answer in time.
    #[error("the sound server does not answer")]
    Slow,
    /// The server refuses what it is asked for.
    #[error("the sound server refuses: {0}")]
    Refused(PulseError),
    /// The server says something that makes no sense.
    #[error("the sound server and this program do not understand each other")]
    Protocol(#[source] ProtocolError),
    /// The connection has failed.
    #[error("the connection to the sound server has failed")]
    Connection(#[from] std::io::Error),
}

impl From<ProtocolError> for SoundError {
    /// A cause that the protocol's error repeats in its own message becomes this error's cause itself.
    fn from(error: ProtocolError) -> Self {
        match error {
            ProtocolError::ServerError(why) => Self::Refused(why),
            ProtocolError::Io(why) => Self::Connection(why),
            ProtocolError::Timeout => Self::Slow,
            other => Self::Protocol(other),
        }
    }
}

fn or_none(names: &[String]) -> String {
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}
