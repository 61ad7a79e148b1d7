//! From a scene to a person who stands upright at the origin and faces +z, with key points of body and face.

use crate::points::KeyPoint;
use crate::scan::Scan;
use motion_fit::landmarks::{BODY_LANDMARKS, FACE_LANDMARKS};

/// A scan that stands in the person's space, and what networks saw of it.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// The person's Gaussians, surroundings cut away.
    pub scan: Scan,
    /// BlazePose's landmarks.
    pub body: [KeyPoint; BODY_LANDMARKS],
    /// The face mesh's landmarks, where a face was seen.
    pub face: Option<Box<[KeyPoint; FACE_LANDMARKS]>>,
}
