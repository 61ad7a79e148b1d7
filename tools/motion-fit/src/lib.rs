//! Motion parameters from landmarks or rotations: the avatar's own skeleton, fingers and face fitted to what networks saw in one or more cameras.
//!
//! It knows landmarks and time, but no images, networks or devices.

pub mod align;
pub mod body;
pub mod face;
pub mod hands;
pub mod landmarks;
mod motion_fit;
mod rotations;
pub mod smoother;

pub use landmarks::estimates;
pub use motion_fit::{Fitted, MotionFit, Subject};
