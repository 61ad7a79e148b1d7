//! What networks saw in one picture, in the picture's own coordinates.
//!
//! Pixels: x to the right, y down, the centre of the first pixel at (0.5, 0.5). Camera axes: x right, y down, z away from the camera,
//! metres. Left and right are the person's own.

pub mod blazepose;
pub mod estimates;

pub use estimates::Observation;

use glam::{DQuat, DVec2, DVec3, Vec2, Vec3};

/// Landmarks of the body, in the order of BlazePose (MediaPipe's pose landmarker).
pub const BODY_LANDMARKS: usize = 33;
/// Landmarks of one hand, in MediaPipe's order: wrist, then thumb, index, middle, ring, little finger, each from its root to its tip.
pub const HAND_LANDMARKS: usize = 21;
/// Landmarks of the face, in the order of MediaPipe's face mesh with irises: 468 of the mesh, then five for each iris, the person's
/// right eye's (the left one in the picture) first.
pub const FACE_LANDMARKS: usize = 478;

/// Field of view along the longer side of the pictures of many laptops and phones, degrees.
pub const USUAL_VIEW_DEGREES: f32 = 65.0;

/// A pinhole camera without distortion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Width and height of the picture in pixels.
    pub size: Vec2,
    /// Focal length in pixels.
    pub focal: f32,
    /// Principal point in pixels.
    pub centre: Vec2,
}

impl Camera {
    /// A camera of that picture size in pixels, with a field of view of so many degrees along the picture's longer side.
    #[must_use]
    pub fn of_view(size: Vec2, degrees: f32) -> Self {
        Self {
            size,
            focal: size.max_element() / 2.0 / (degrees.to_radians() / 2.0).tan(),
            centre: size / 2.0,
        }
    }

    /// The rotation from the camera's axis to the line of sight to `pixel`. A network that looks at a part of the picture sees what is there
    /// as if along the axis: turned by the opposite. The identity where no lens without distortion sees.
    pub(crate) fn line_of_sight(&self, pixel: DVec2) -> DQuat {
        let aside = (pixel - self.centre.as_dvec2()) / f64::from(self.focal);
        if aside.is_finite() && self.focal > 0.0 && aside.length() < 3.0 {
            DQuat::from_rotation_arc(DVec3::Z, aside.extend(1.0).normalize())
        } else {
            DQuat::IDENTITY
        }
    }

    /// A camera whose lens is not known: [`USUAL_VIEW_DEGREES`].
    #[must_use]
    pub fn guessed(size: Vec2) -> Self {
        Self::of_view(size, USUAL_VIEW_DEGREES)
    }
}

/// One landmark of a body.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BodyPoint {
    /// Where it is in the picture, pixels.
    pub pixel: Vec2,
    /// Where it is relative to the middle of the hips, as the network guesses it: metres in the axes of a camera that looks straight at
    /// the hips.
    pub metres: Vec3,
    /// Probability that it is visible and right, 0..=1.
    pub confidence: f32,
}

/// What a network saw of a body.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyLandmarks {
    /// The landmarks in BlazePose's order.
    pub points: [BodyPoint; BODY_LANDMARKS],
}

/// What a network saw of a hand.
#[derive(Debug, Clone, PartialEq)]
pub struct HandLandmarks {
    /// In the picture, pixels.
    pub pixels: [Vec2; HAND_LANDMARKS],
    /// Relative to the hand's own middle, metres in camera axes.
    pub metres: [Vec3; HAND_LANDMARKS],
    /// Probability that there is a hand, 0..=1.
    pub confidence: f32,
}

/// What a network saw of a face.
#[derive(Debug, Clone, PartialEq)]
pub struct FaceLandmarks {
    /// In the picture: x and y in pixels, z in the same unit, away from the camera, relative to the head's middle.
    pub points: Box<[Vec3; FACE_LANDMARKS]>,
    /// Probability that there is a face, 0..=1.
    pub confidence: f32,
}
