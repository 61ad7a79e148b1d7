//! What can end a training.

use avatar_gradient::ModelError;
use capture::CaptureError;
use splat_gradient::error::GradientError;
use spmm3::{PackageError, PersonError};
use std::path::{Path, PathBuf};

/// Why an avatar could not be trained, or its state not be kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// A picture, or the capture as a whole, cannot be read.
    #[error("the capture")]
    Capture(#[from] CaptureError),
    /// A camera by which nothing can be drawn, or sizes that contradict each other.
    #[error("drawing the avatar")]
    Gradient(#[from] GradientError),
    /// The perceptual loss failed.
    #[error("judging the drawn picture")]
    Perceptual(#[source] GradientError),
    /// The first avatar's parts do not fit each other.
    #[error("the avatar's model")]
    Model(#[from] ModelError),
    /// Networks of the first avatar that are not in the form this program writes.
    #[error(
        "the first avatar's networks cannot be read: {0}; take an avatar that this program made"
    )]
    Network(String),
    /// What was learnt does not make an avatar.
    #[error("the learnt avatar")]
    Person(#[from] PersonError),
    /// The avatar's package cannot be read or written.
    #[error("the avatar's package")]
    Package(#[from] PackageError),
    /// The capture does not say how the person stands.
    #[error(
        "the capture has no motion: complete it before training (mon3tr-dev capture check says what is missing)"
    )]
    NoMotion,
    /// A picture without a mask.
    #[error(
        "camera {camera}, frame {frame}: no mask, so that person and background cannot be told apart; complete the capture before training"
    )]
    NoMask {
        /// The camera's name.
        camera: String,
        /// The frame's number.
        frame: usize,
    },
    /// A picture whose mask is not of its size, or whose size is not its camera's.
    #[error(
        "camera {camera}, frame {frame}: {what} of {got} bytes, {expected} expected from the camera's size"
    )]
    PictureSize {
        /// The camera's name.
        camera: String,
        /// The frame's number.
        frame: usize,
        /// The picture or its mask.
        what: &'static str,
        /// Its bytes.
        got: usize,
        /// The bytes of a picture of the camera's size.
        expected: usize,
    },
    /// A camera whose pictures are larger than what can be drawn.
    #[error(
        "camera {camera}: its pictures have {width} x {height} pixels, and at most {most} x {most} can be drawn: make the capture's pictures smaller"
    )]
    CameraSize {
        /// The camera's name.
        camera: String,
        /// Its pictures' width, pixels.
        width: u32,
        /// Their height, pixels.
        height: u32,
        /// The longest side that can be drawn, pixels.
        most: usize,
    },
    /// No picture is left to train on.
    #[error("no picture to train on: {0}")]
    NoPictures(String),
    /// An option out of its range.
    #[error("{what} is {value}; it must be {range}")]
    Option {
        /// Which option.
        what: &'static str,
        /// What it is.
        value: String,
        /// What it may be.
        range: &'static str,
    },
    /// A number became infinite or none, at a step.
    #[error(
        "at step {step} (camera {camera}, frame {frame}) {what} is not finite; nothing was learnt from this picture, and the checkpoint is from before: if the picture and the capture's poses of this frame look right, train anew with another seed"
    )]
    NotFinite {
        /// Steps that were made before.
        step: u64,
        /// The camera of the step's picture.
        camera: String,
        /// The frame of it.
        frame: usize,
        /// Which number.
        what: &'static str,
    },
    /// A checkpoint that is damaged, or of another training.
    #[error("the checkpoint {path}: {reason}")]
    Checkpoint {
        /// Its file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A file that could not be read or written.
    #[error("cannot {action} {path}")]
    File {
        /// What was tried.
        action: &'static str,
        /// On what.
        path: PathBuf,
        /// Why not.
        #[source]
        source: std::io::Error,
    },
}

impl TrainError {
    /// A checkpoint at `path` that cannot be used, for `reason`.
    pub(crate) fn checkpoint(path: &Path, reason: impl Into<String>) -> Self {
        Self::Checkpoint {
            path: path.to_path_buf(),
            reason: reason.into(),
        }
    }
}
