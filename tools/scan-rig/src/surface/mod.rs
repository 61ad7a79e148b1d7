//! What can be seen of a scan: its surface from many views, and how much of each Gaussian shows.

mod extract;
pub mod raster;
mod views;

pub use extract::{Survey, survey};
pub(crate) use views::{DepthView, around};

use glam::Vec3;

/// The outer surface of a scan, sampled.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surface {
    /// Points, metres.
    pub points: Vec<Vec3>,
    /// Unit normals, outwards.
    pub normals: Vec<Vec3>,
}
