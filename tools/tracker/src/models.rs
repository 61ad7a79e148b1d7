//! What a network for a body, a hand or a face must be able to do, so that others can be put in their places.
//!
//! A model sees landmarks in the picture or gives joint rotations; the fit takes both. It owns its sessions and its memory of the
//! last picture, and is run by one thread.

use crate::TrackerError;
use crate::picture::PictureView;
pub use motion_fit::estimates::{
    BodyEstimate, BodyHints, BodyRotations, FaceEstimate, FaceExpression, FaceHint, HandEstimate,
    HandHint, HandRotations, JointRotation,
};
pub use motion_fit::hands::Side;
use std::fmt;

/// Finds a body in pictures.
pub trait BodyModel: Send {
    /// The body in `picture`, whose light fell at `seconds`; nothing if there is none.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if a network fails.
    fn run(
        &mut self,
        picture: PictureView<'_>,
        seconds: f64,
    ) -> Result<Option<BodyEstimate>, TrackerError>;

    /// How many people were seen when the model last looked at the whole picture; nothing if it never did.
    fn people(&self) -> Option<usize> {
        None
    }
}

/// Finds both hands of a person. Every picture is looked at in two steps: [`Self::follow`] while the body's model is still at work
/// on the same picture, then [`Self::find`] or [`Self::forget`] when it has ended.
pub trait HandModel: Send {
    /// Looks where the hand was in the last picture; nothing if it was not seen there, or is lost, or has to be searched anew.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if a network fails.
    fn follow(
        &mut self,
        picture: PictureView<'_>,
        side: Side,
    ) -> Result<Option<HandEstimate>, TrackerError>;

    /// The hand in `picture`: `followed` if that agrees with where the body has its hand, else what is found there.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if a network fails.
    fn find(
        &mut self,
        picture: PictureView<'_>,
        side: Side,
        hint: &HandHint,
        followed: Option<HandEstimate>,
    ) -> Result<Option<HandEstimate>, TrackerError>;

    /// The hand cannot be in this picture: no body was found in it.
    fn forget(&mut self, side: Side);
}

/// Finds a person's face, in the same two steps as [`HandModel`].
pub trait FaceModel: Send {
    /// Looks where the face was in the last picture; nothing if it was not seen there, or is lost, or has to be searched anew.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if a network fails.
    fn follow(&mut self, picture: PictureView<'_>) -> Result<Option<FaceEstimate>, TrackerError>;

    /// The face in `picture`: `followed` if that agrees with the body, else what is found where the body has its face, or in the whole
    /// picture if no body was found.
    ///
    /// # Errors
    /// [`TrackerError::Runtime`] if a network fails.
    fn find(
        &mut self,
        picture: PictureView<'_>,
        hint: Option<&FaceHint>,
        followed: Option<FaceEstimate>,
    ) -> Result<Option<FaceEstimate>, TrackerError>;
}

/// The models of a tracker.
pub struct Models {
    /// The body's.
    pub body: Box<dyn BodyModel>,
    /// The hands'.
    pub hands: HandModels,
    /// The face's, if it is to be tracked.
    pub face: Option<Box<dyn FaceModel>>,
}

/// How hands are looked at.
pub enum HandModels {
    /// Not at all.
    None,
    /// By one model, the left one in a picture and the right one in the next.
    Alternating(Box<dyn HandModel>),
    /// The left and the right one by a model of its own, at the same time.
    Each([Box<dyn HandModel>; 2]),
}

impl fmt::Debug for Models {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Models")
            .field("hands", &self.hands)
            .field("face", &self.face.is_some())
            .finish_non_exhaustive()
    }
}

impl fmt::Debug for HandModels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "none",
            Self::Alternating(_) => "alternating",
            Self::Each(_) => "each",
        })
    }
}
