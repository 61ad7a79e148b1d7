//! People's calls shown on a display: joined, placed in the viewer's room, measured, and left.

pub mod call;
pub mod headset;
pub mod overlay;
pub mod presence;
pub mod visit;
