//! What a network for a body, a hand or a face must be able to do, so that others can be put in their places.
//!
//! A model sees landmarks in the picture or gives joint rotations; the fit takes both. It owns its sessions and its memory of the
//! last picture, and is run by one thread.

use crate::TrackerError;
use crate::picture::PictureView;
use glam::{Quat, Vec2};
use motion_fit::landmarks::{BodyLandmarks, FaceLandmarks, HandLandmarks};
use std::fmt;

/// One of a person's own sides, as an index of pairs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The person's left.
    Left,
    /// The person's right.
    Right,
}

impl Side {
    /// Both, in the order of pairs.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// Its place in a pair.
    #[must_use]
    pub fn index(self) -> usize {
        match self {
            Self::Left => 0,
            Self::Right => 1,
        }
    }
}

/// A joint's rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointRotation {
    /// In the parent's frame, as SMPL-X defines the joint.
    pub rotation: Quat,
    /// Probability that it is right, 0..=1.
    pub confidence: f32,
}

/// Where hands and face are, as far as the body's model knows, in pixels of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BodyHints {
    /// The person's left and right hand.
    pub hands: [Option<HandHint>; 2],
    /// The face.
    pub face: Option<FaceHint>,
}

/// Where a hand is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandHint {
    /// The wrist, pixels.
    pub wrist: Vec2,
    /// The index finger's root, pixels.
    pub index: Vec2,
    /// The little finger's root, pixels.
    pub little: Vec2,
    /// Probability that the wrist is visible, 0..=1.
    pub confidence: f32,
}

/// Where a face is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaceHint {
    /// The first eleven landmarks of a body (nose, eyes, ears, mouth), pixels.
    pub points: [Vec2; 11],
}

/// What a body's model gives.
#[derive(Debug, Clone, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "the usual one is the large one: boxed, it would be allocated for every picture"
)]
pub enum BodyEstimate {
    /// Landmarks in the picture.
    Landmarks(BodyLandmarks),
    /// Joint rotations, and where hands and face are.
    Rotations {
        /// The pelvis in camera axes, then SMPL-X's 21 joints of the body.
        joints: Box<[JointRotation; 22]>,
        /// For the models of hands and face.
        hints: BodyHints,
    },
}

impl BodyEstimate {
    /// Where hands and face are.
    #[must_use]
    pub fn hints(&self) -> BodyHints {
        let landmarks = match self {
            Self::Rotations { hints, .. } => return *hints,
            Self::Landmarks(landmarks) => landmarks,
        };
        let points = &landmarks.points;
        let hand = |wrist: usize, little: usize, index: usize| HandHint {
            wrist: points[wrist].pixel,
            little: points[little].pixel,
            index: points[index].pixel,
            confidence: points[wrist].confidence,
        };
        BodyHints {
            hands: [Some(hand(15, 17, 19)), Some(hand(16, 18, 20))],
            face: Some(FaceHint {
                points: std::array::from_fn(|i| points[i].pixel),
            }),
        }
    }
}

/// What a hand's model gives.
#[derive(Debug, Clone, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "the usual one is the large one: boxed, it would be allocated for every picture"
)]
pub enum HandEstimate {
    /// Landmarks in the picture.
    Landmarks(HandLandmarks),
    /// The wrist in camera axes, then SMPL-X's 15 joints of that hand.
    Rotations(Box<[JointRotation; 16]>),
}

/// What a face's model gives.
#[derive(Debug, Clone, PartialEq)]
pub enum FaceEstimate {
    /// Landmarks in the picture.
    Landmarks(FaceLandmarks),
    /// The jaw's rotation and weights of SMPL-X's expression.
    Expression {
        /// The jaw.
        jaw: JointRotation,
        /// Weights, in standard deviations.
        weights: Vec<f32>,
    },
}

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
    /// Both by one model, one after the other.
    Shared(Box<dyn HandModel>),
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
            Self::Shared(_) => "shared",
            Self::Alternating(_) => "alternating",
            Self::Each(_) => "each",
        })
    }
}
