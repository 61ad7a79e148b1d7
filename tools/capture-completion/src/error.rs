//! What can go wrong while a capture is completed.

use capture::CaptureError;
use std::path::PathBuf;
use tracker::TrackerError;
use tracker::source::SourceError;

/// A capture that cannot be completed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompletionError {
    /// The capture itself, or what is written of it.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The networks.
    #[error(transparent)]
    Tracker(Box<TrackerError>),
    /// A video.
    #[error(transparent)]
    Source(Box<SourceError>),
    /// A video does not fit its camera, or the folder is none of videos.
    #[error("{path} {reason}")]
    Video {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Nobody is in the pictures.
    #[error(
        "no camera sees a person in any of the {frames} frames: check that the pictures show one, upright, and not too small"
    )]
    Nobody {
        /// Frames that were looked at.
        frames: usize,
    },
}

// Boxed: both are large, and results with them are passed for every picture.
impl From<TrackerError> for CompletionError {
    fn from(error: TrackerError) -> Self {
        Self::Tracker(Box::new(error))
    }
}

impl From<SourceError> for CompletionError {
    fn from(error: SourceError) -> Self {
        Self::Source(Box::new(error))
    }
}
