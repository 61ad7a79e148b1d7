//! What can go wrong between a capture and a first avatar.

use capture::CaptureError;
use scan_rig::RigError;
use spmm3::PersonError;

/// Why a capture did not become an avatar, and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TemplateError {
    /// The capture cannot be read.
    #[error("cannot read the capture")]
    Capture(#[source] Box<CaptureError>),
    /// The body model cannot be built.
    #[error("cannot build the body model of the MakeHuman files")]
    Body(#[from] RigError),
    /// The parts of the avatar do not fit each other: a fault of this program.
    #[error("cannot assemble the avatar")]
    Person(#[from] PersonError),
    /// There is no motion.
    #[error(
        "the capture has no motion (no pose of the person in each frame): complete it first, or put a motion.npz beside its pictures"
    )]
    NoPoses,
    /// A pose is no pose.
    #[error("the pose of frame {frame} {reason}: make the capture's motion again")]
    Pose {
        /// Which frame.
        frame: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// No picture has a mask.
    #[error(
        "none of the {pictures} chosen pictures has a mask with a person in it: complete the capture first, or put masks beside its pictures"
    )]
    NoMasks {
        /// How many pictures were looked at.
        pictures: usize,
    },
    /// Too little of the person is seen.
    #[error(
        "the person is seen in {views} pictures of {frames} frames only, of which at least {least} are needed: use more frames or cameras for training"
    )]
    TooFewViews {
        /// Pictures with a person.
        views: usize,
        /// Frames that were looked at.
        frames: usize,
        /// How many are needed.
        least: usize,
    },
    /// The body cannot be brought onto the masks.
    #[error(
        "the body model covers the masks by {:.0} % only (intersection over union): poses, calibration or masks do not belong together; check the capture's \
         world axes (y up, metres), its cameras and its motion",
        overlap * 100.0
    )]
    NoFit {
        /// Intersection over union, 0..=1.
        overlap: f64,
    },
    /// The caller asked for what is not possible.
    #[error("{0}")]
    Options(String),
}

impl From<CaptureError> for TemplateError {
    fn from(error: CaptureError) -> Self {
        Self::Capture(Box::new(error))
    }
}
