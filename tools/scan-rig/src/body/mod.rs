//! The body model and its registration to a scan.

mod alignment;
mod closed_in;
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
pub(crate) mod tests;

pub use confidence::{Heeded, UNSURE, error_of};
pub use model::{BodyModel, BodyPart, SkinRow};
pub use register::{FitReport, Observed, register};

use glam::{DMat3, DQuat, DVec3};
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

impl Registered {
    /// Where the body faces, level and of unit length: across the lines of shoulders and hips. Nothing if they stand upright.
    #[must_use]
    pub fn facing(&self) -> Option<DVec3> {
        let at = |joint: Joint| self.joints[joint.index()];
        let shoulders = at(Joint::LeftShoulder) - at(Joint::RightShoulder);
        let hips = at(Joint::LeftHip) - at(Joint::RightHip);
        (shoulders + hips).cross(DVec3::Y).try_normalize()
    }

    /// Everything turned about the origin.
    pub fn turn(&mut self, turn: DQuat) {
        let matrix = DMat3::from_quat(turn);
        self.rotations.iter_mut().for_each(|r| *r = matrix * *r);
        self.joints
            .iter_mut()
            .for_each(|joint| *joint = turn * *joint);
        self.vertices
            .iter_mut()
            .for_each(|vertex| *vertex = turn * *vertex);
    }
}
