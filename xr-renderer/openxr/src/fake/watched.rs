//! What body, face and eyes of the wearer do.

use openxr::sys;
use openxr::{Posef, SpaceLocationFlags};

/// What the runtime tells of the wearer, given the extension and the headset. Poses are in the room.
#[derive(Debug, Clone)]
pub(crate) struct Watched {
    pub(crate) body_active: bool,
    pub(crate) body_confidence: f32,
    /// In the order of `XrFullBodyJointMETA`.
    pub(crate) body: [sys::BodyJointLocationFB; 84],
    /// The same in T-pose, and how often it changed.
    pub(crate) skeleton: [Posef; 84],
    pub(crate) skeleton_changes: u32,
    pub(crate) face_valid: bool,
    pub(crate) face_eyes_valid: bool,
    pub(crate) face_source: sys::FaceTrackingDataSource2FB,
    pub(crate) face: [f32; 70],
    pub(crate) face_confidences: [f32; 2],
    /// Left, right; each with its confidence, if it is valid.
    pub(crate) gazes: [Option<(Posef, f32)>; 2],
}

impl Default for Watched {
    fn default() -> Self {
        Self {
            body_active: false,
            body_confidence: 0.0,
            body: [sys::BodyJointLocationFB {
                location_flags: SpaceLocationFlags::EMPTY,
                pose: Posef::IDENTITY,
            }; 84],
            skeleton: [Posef::IDENTITY; 84],
            skeleton_changes: 0,
            face_valid: false,
            face_eyes_valid: false,
            face_source: sys::FaceTrackingDataSource2FB::VISUAL,
            face: [0.0; 70],
            face_confidences: [0.0; 2],
            gazes: [None; 2],
        }
    }
}
