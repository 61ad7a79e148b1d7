//! A camera as a source of motion: pictures, networks for body, hands and face, and the fit of what they saw.

pub mod crop;
pub mod custom;
pub mod error;
pub mod mediapipe;
pub mod models;
pub mod networks;
pub mod picture;
pub mod source;
pub mod workers;

pub use error::TrackerError;
pub use workers::Tracker;
