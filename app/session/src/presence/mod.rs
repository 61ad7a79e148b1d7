//! Remote people in the viewer's room: where each stands, how hands move them, who sits, and the shadow at their feet.
//!
//! Two spaces meet here. *Floor space* is the room's: metres, y up, the floor at y = 0, the origin below the viewer at
//! start, who looks along -z. *Motion space* is a person's own: metres, y up, the floor at y = 0, facing +z at rest, and
//! the root translation walks about in it. From one to the other leads a turn about y and a shift along the floor, so
//! that a person has their true size and their feet stay on the floor. Nothing here knows of a device or the time of day.

mod grab;
mod lineup;
mod people;
mod place;
mod seat;
mod shadow;
mod standing;
mod viewer;

pub use lineup::Lineup;
pub use people::{APART, Presence};
pub use place::DISTANCE;
pub use seat::Seated;
pub use shadow::{ContactShadow, SHADOW_GAUSSIANS, contact_shadow};
pub(crate) use standing::first_apart;
pub use standing::{BODY_JOINTS, SOLE_POINTS, Standing};
pub use viewer::Viewer;

#[cfg(test)]
mod tests;
