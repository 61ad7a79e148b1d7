//! What can be seen of a scan: its surface from many views, and how much of each Gaussian shows.

mod extract;
pub mod raster;
mod views;

pub use extract::{Look, look};
pub use views::{DepthView, around, head};

use glam::Vec3;

/// The outer surface of a scan, sampled.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surface {
    /// Points, metres.
    pub points: Vec<Vec3>,
    /// Unit normals, outwards.
    pub normals: Vec<Vec3>,
}

/// How much of each Gaussian shows in any of the views.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Visibility {
    /// The largest blending weight that it has in any pixel of any view, 0..=1.
    pub peak: Vec<f32>,
    /// The largest sum of blending weights in one view, pixels.
    pub sum: Vec<f32>,
}
