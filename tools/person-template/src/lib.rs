//! From a capture of a person (calibrated pictures, masks, poses) to a first avatar (paper, section IV-A): a valid package, and what training goes on from.
//!
//! The order of the work, in [`first_avatar`]: frames and cameras are chosen (`observe`) -> the body model's shape is registered once to all outlines
//! (`register`, `rim`) -> clothes and hair as a displacement in T-pose (`clothes`, `guard`) -> the poses of all frames (`frames`) -> Gaussians spread over the template and coloured by the
//! photographs (`spread`, `colour`) -> the package (`assemble`). Skinning weights, face, hands, expressions are the body model's, so no weight
//! crosses from an arm to the trunk, however they touch in the pictures.
//!
//! [`align`] comes before all that, where calibration and poses are a tracker's: by the same outlines it turns the cameras, and bends the poses of all frames.
//!
//! Deviation from the paper: its body mesh is a surface reconstruction into which faces and hands are sewn. Here the body model's own surface grows to the
//! outlines, so the mesh is closed, and expressions and fingers fit it without a seam; hollows that no outline shows stay the body's, and skirts hang on legs.
//!
//! Space: metres, y up. T-pose: facing +z, +x is the person's left.

#![forbid(unsafe_code)]

mod align;
mod assemble;
mod body;
mod clothes;
mod colour;
mod distance;
mod error;
mod first;
mod frames;
mod guard;
mod observe;
mod posing;
pub mod raster;
mod register;
mod report;
mod rim;
mod spread;
#[cfg(test)]
mod tests;

pub use align::{Aligned, align};
pub use error::TemplateError;
pub use first::{First, LEAST_GAUSSIANS, TemplateOptions, first_avatar};
pub use report::TemplateReport;
