//! The body model and its registration to a scan.

pub mod model;
pub mod posing;

pub use model::{BodyModel, BodyPart, SkinRow};

use glam::{DMat3, DVec3};
use spmm3::JOINTS;

/// A body model as it was registered to a scan.
#[derive(Debug, Clone)]
pub struct Registered {
    /// Weights of the model's shapes.
    pub shape: Vec<f64>,
    /// World rotations of the joints relative to the model's rest pose.
    pub rotations: [DMat3; JOINTS],
    /// Uniform scale of the model.
    pub scale: f64,
    /// Where the joints are in the scan's pose, metres.
    pub joints: [DVec3; JOINTS],
    /// The model's vertices in the scan's pose, on the scan's surface where it was seen, metres.
    pub vertices: Vec<DVec3>,
    /// How sure each joint is, 0..=1.
    pub confidence: [f64; JOINTS],
}
