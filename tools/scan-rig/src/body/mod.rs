//! The body model and its registration to a scan.

mod alignment;
mod confidence;
mod derivatives;
mod face;
mod face_vertices;
mod fit;
mod follow;
mod landmarks;
pub mod laplacian;
mod match_surface;
pub mod model;
mod nonrigid;
pub mod normal_equations;
pub mod posing;
mod register;
pub mod state;
#[cfg(test)]
mod tests;

pub use model::{BodyModel, BodyPart, SkinRow};
pub use register::{FitReport, Observed, register};

use glam::{DMat3, DVec3};
use spmm3::{JOINTS, Joint};

/// Where a joint is, as the user knows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hint {
    /// Which.
    pub joint: Joint,
    /// Metres, in the scan's pose, in the person's space.
    pub position: DVec3,
}

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
