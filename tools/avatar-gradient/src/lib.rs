//! From motion to Gaussians, and back: an avatar's forward pass as the receiver computes it, and the derivatives of a loss by every
//! number of the avatar and by the pose.
//!
//! [`Model::pose`] is the paper's sections IV-A to IV-C: motion parameters P -> joint transforms -> F_mesh -> LBS -> F_m2g and F_attr
//! -> Gaussians in the world, in the layout that `splat-gradient` draws. [`Model::backward`] takes the derivatives of a loss by those
//! Gaussians and by the vertices and adds those by all [`Parameters`]; it returns those by the pose. The terms of the paper that look
//! at Gaussians and controllers instead of pictures are in [`loss`]. [`Parameters`] come from the networks of a package and go back into them.
//!
//! Everything is a function of its inputs alone: the number of threads does not change a bit, since no sum depends on who was first.
//! What is drawn of the Gaussians, where the pictures come from and how a training is arranged is not here.

#![forbid(unsafe_code)]

mod attributes;
mod bases;
mod basis_derivatives;
mod binding;
mod correction;
mod error;
mod exchange;
mod kinematics;
mod layer;
pub mod loss;
mod mesh;
mod model;
mod offsets;
mod parameters;
mod planes;
mod posed;
mod skinning;
mod step;
mod vector;

pub use correction::{CORRECTION, PoseCorrection};
pub use error::ModelError;
pub use exchange::Networks;
pub use model::{Derivatives, Model, Parts};
pub use parameters::{Layer, Parameters, Sizes};
pub use posed::Posed;
pub use step::{Moved, step_bases};
