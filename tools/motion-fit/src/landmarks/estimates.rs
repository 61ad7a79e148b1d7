//! What models give of one picture: landmarks, or rotations of joints and weights of expressions.
//!
//! Rotations in camera axes turn what stands in the axes of the avatar's T-pose (y up, facing +z) into the camera's (x right, y down,
//! z away): a person who faces the camera has a pelvis turned by half a turn about x.

use super::{BodyLandmarks, FaceLandmarks, HandLandmarks};
use glam::{Quat, Vec2};
use spmm3::ExpressionBasis;

/// Joints of a body that a model turns: the pelvis, then SMPL-X's 21 others.
pub const BODY_ROTATIONS: usize = 22;
/// Joints of a hand that a model turns: the wrist, then SMPL-X's 15 of the fingers.
pub const HAND_ROTATIONS: usize = 16;

/// A joint's rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointRotation {
    /// In the parent's frame, as SMPL-X defines the joint, or in camera axes where a structure says so.
    pub rotation: Quat,
    /// Probability that it is right, 0..=1; zero: the model does not know this joint.
    pub confidence: f32,
}

impl JointRotation {
    /// A joint that a model does not know.
    pub const UNKNOWN: Self = Self {
        rotation: Quat::IDENTITY,
        confidence: 0.0,
    };

    /// The rotation, if it is known and can be one.
    #[must_use]
    pub fn known(&self) -> Option<Quat> {
        let good = self.confidence > 0.0 && self.rotation.is_finite();
        let length = self.rotation.length_squared();
        (good && length > 1e-6).then(|| self.rotation.normalize())
    }
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

/// A body as rotations of its joints.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyRotations {
    /// The pelvis in camera axes, then SMPL-X's 21 joints of the body in their parents' frames.
    pub joints: [JointRotation; BODY_ROTATIONS],
    /// The pixel along whose line of sight the network saw the body as if it were before the camera: camera axes are turned towards
    /// it. Nothing if they are the camera's own.
    pub sight: Option<Vec2>,
    /// Landmarks in the same picture: where the person stands, and joints without rotations, are taken from them.
    pub landmarks: Option<BodyLandmarks>,
    /// For the models of hands and face, where there are no landmarks.
    pub hints: BodyHints,
}

/// A hand as rotations of its joints.
#[derive(Debug, Clone, PartialEq)]
pub struct HandRotations {
    /// The wrist in camera axes, then SMPL-X's 15 joints of that hand in their parents' frames: index, middle, pinky, ring, thumb.
    pub joints: [JointRotation; HAND_ROTATIONS],
    /// As [`BodyRotations::sight`].
    pub sight: Option<Vec2>,
    /// Landmarks in the same picture: joints without rotations are taken from them.
    pub landmarks: Option<HandLandmarks>,
}

/// A face as weights of an expression and rotations.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceExpression {
    /// What the weights mean; nothing if there are none: the expression is then taken from the landmarks.
    pub basis: Option<ExpressionBasis>,
    /// Weights; those that are missing are zero.
    pub weights: Vec<f32>,
    /// The jaw, in the head's frame.
    pub jaw: JointRotation,
    /// The left and the right eye, in the head's frame.
    pub eyes: [JointRotation; 2],
    /// The head, in camera axes.
    pub head: JointRotation,
    /// How far the left and the right eye's lids are shut, 0..=1, where the weights do not say it.
    pub eyelids: Option<[f32; 2]>,
    /// Probability that there is a face, 0..=1.
    pub confidence: f32,
    /// As [`BodyRotations::sight`].
    pub sight: Option<Vec2>,
    /// Landmarks in the same picture: head and gaze are taken from them where they are unknown.
    pub landmarks: Option<FaceLandmarks>,
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
    /// Joint rotations.
    Rotations(Box<BodyRotations>),
}

/// What a hand's model gives.
#[derive(Debug, Clone, PartialEq)]
#[allow(
    clippy::large_enum_variant,
    reason = "the usual one is the large one: boxed, it would be allocated for every picture"
)]
pub enum HandEstimate {
    /// Landmarks of MediaPipe, whose bias is known.
    Landmarks(HandLandmarks),
    /// Landmarks of another network, in the middles of the joints.
    Joints(HandLandmarks),
    /// Joint rotations.
    Rotations(Box<HandRotations>),
}

/// What a face's model gives.
#[derive(Debug, Clone, PartialEq)]
pub enum FaceEstimate {
    /// Landmarks in the picture.
    Landmarks(FaceLandmarks),
    /// Weights of an expression.
    Expression(Box<FaceExpression>),
}

impl BodyEstimate {
    /// The landmarks, or those that came with rotations.
    #[must_use]
    pub fn landmarks(&self) -> Option<&BodyLandmarks> {
        match self {
            Self::Landmarks(landmarks) => Some(landmarks),
            Self::Rotations(rotations) => rotations.landmarks.as_ref(),
        }
    }

    /// Where hands and face are.
    #[must_use]
    pub fn hints(&self) -> BodyHints {
        let points = match self {
            Self::Rotations(rotations) => match &rotations.landmarks {
                None => return rotations.hints,
                Some(landmarks) => &landmarks.points,
            },
            Self::Landmarks(landmarks) => &landmarks.points,
        };
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

impl HandEstimate {
    /// The landmarks, or those that came with rotations.
    #[must_use]
    pub fn landmarks(&self) -> Option<&HandLandmarks> {
        match self {
            Self::Landmarks(landmarks) | Self::Joints(landmarks) => Some(landmarks),
            Self::Rotations(rotations) => rotations.landmarks.as_ref(),
        }
    }
}

impl FaceEstimate {
    /// The landmarks, or those that came with an expression.
    #[must_use]
    pub fn landmarks(&self) -> Option<&FaceLandmarks> {
        match self {
            Self::Landmarks(landmarks) => Some(landmarks),
            Self::Expression(expression) => expression.landmarks.as_ref(),
        }
    }
}

impl From<BodyLandmarks> for BodyEstimate {
    fn from(landmarks: BodyLandmarks) -> Self {
        Self::Landmarks(landmarks)
    }
}

impl From<HandLandmarks> for HandEstimate {
    fn from(landmarks: HandLandmarks) -> Self {
        Self::Landmarks(landmarks)
    }
}

impl From<FaceLandmarks> for FaceEstimate {
    fn from(landmarks: FaceLandmarks) -> Self {
        Self::Landmarks(landmarks)
    }
}

/// What was seen in one picture; each part may be missing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Observation {
    /// When the light fell, seconds on the source's clock.
    pub seconds: f64,
    /// The body.
    pub body: Option<BodyEstimate>,
    /// The person's left and right hand.
    pub hands: [Option<HandEstimate>; 2],
    /// Whether the left and the right hand were left out of this picture, because hands take turns: nothing is known of them.
    pub hands_skipped: [bool; 2],
    /// The face.
    pub face: Option<FaceEstimate>,
}

impl Observation {
    /// The body's landmarks, if its model gave any.
    #[must_use]
    pub fn body_landmarks(&self) -> Option<&BodyLandmarks> {
        self.body.as_ref().and_then(BodyEstimate::landmarks)
    }

    /// The landmarks of the left and the right hand, where models gave any.
    #[must_use]
    pub fn hand_landmarks(&self) -> [Option<&HandLandmarks>; 2] {
        let [left, right] = &self.hands;
        [left, right].map(|hand| hand.as_ref().and_then(HandEstimate::landmarks))
    }

    /// The face's landmarks, if its model gave any.
    #[must_use]
    pub fn face_landmarks(&self) -> Option<&FaceLandmarks> {
        self.face.as_ref().and_then(FaceEstimate::landmarks)
    }
}
