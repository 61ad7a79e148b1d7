//! Motion parameters from landmarks: the avatar's own skeleton, fingers and face fitted to what networks saw in one or more cameras.
//!
//! It knows landmarks and time, but no images, networks or devices.

pub mod align;
pub mod body;
pub mod face;
pub mod hands;
mod head_only;
pub mod landmarks;
mod motion_fit;
pub mod smoother;

pub use motion_fit::{Fitted, MotionFit, Subject};
