//! What a reader of a layout finds.

use crate::camera::Camera;
use crate::files::Names;
use crate::held_out::HeldOut;
use crate::pose::FramePose;
use spmm3::ExpressionBasis;

/// One camera's files.
#[derive(Debug, Clone)]
pub(crate) struct Pictures {
    pub(crate) frames: Names,
    pub(crate) masks: Option<Names>,
}

/// A capture as its folder has it.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    /// As the pictures are stored: with distortion.
    pub(crate) cameras: Vec<Camera>,
    /// One for each camera.
    pub(crate) pictures: Vec<Pictures>,
    /// The number in the files' names of each frame.
    pub(crate) numbers: Vec<u32>,
    pub(crate) frame_rate: f64,
    pub(crate) poses: Option<Vec<FramePose>>,
    pub(crate) expression_basis: Option<ExpressionBasis>,
    pub(crate) held_out: HeldOut,
    /// What the reader decided or left out, one sentence each.
    pub(crate) notes: Vec<String>,
}
