//! From a scene to a person who stands upright at the origin and faces +z, with key points of body and face.
//!
//! [`prepare`] cuts out what hangs together ([`cut`]), finds the one part that networks take for a standing person and which way is up
//! ([`upright`]), triangulates the body's landmarks ([`body_points`]), has the person stand on the floor ([`stance`]), and looks at the
//! face ([`face_points`]).

pub mod body_points;
pub mod clusters;
pub mod cut;
pub mod face_points;
mod figures;
mod found;
mod hints;
pub mod landmarks;
mod looking;
pub mod networks;
mod person;
mod placing;
pub mod plane;
mod refused;
pub mod sample;
pub mod similarity;
pub mod stance;
pub mod triangulate;
pub mod upright;
pub mod views;

pub use face_points::{Head, face_landmarks_of};
pub use figures::Figures;
pub use found::USUAL_HEIGHT;
pub use networks::Networks;
pub use person::{Options, Prepared, prepare};
pub use similarity::Similarity;
