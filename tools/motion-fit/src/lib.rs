//! Motion parameters from landmarks: the avatar's own skeleton, fingers and face fitted to what networks saw in one or more cameras.
//!
//! It knows landmarks and time, but no images, networks or devices.

pub mod body;
pub mod align;
pub mod face;
pub mod hands;
pub mod landmarks;
pub mod smoother;
