//! What every stage of one picture shares. Offsets are checked against the compiled shaders in
//! `tests/layout.rs`.

use bytemuck::{Pod, Zeroable};

/// One view's camera; `ViewParams` in `shaders/frame.glsl` (std140).
///
/// The image frame is `OpenCV`'s: x right, y down, z forward, metres.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ViewParams {
    /// Rows of the 3x4 rigid transform.
    pub image_from_world: [[f32; 4]; 3],
    /// `fx, fy, cx, cy` in pixels.
    pub intrinsics: [f32; 4],
    /// Least and greatest `x/z`, least and greatest `y/z` at which the Jacobian is taken.
    pub slope_limits: [f32; 4],
    /// Near plane in metres; the rest is not read.
    pub clip: [f32; 4],
}

/// Cameras, sizes and limits of one picture; `FrameParams` in `shaders/frame.glsl` (std140).
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FrameParams {
    /// One or two views.
    pub views: [ViewParams; 2],
    /// Depth of a world point from the head centre: `dot(xyz, p) + w`, metres.
    pub depth_plane: [f32; 4],
    /// Gaussians uploaded for this picture.
    pub gaussian_count: u32,
    /// 1 or 2.
    pub view_count: u32,
    /// Picture width, pixels.
    pub width: u32,
    /// Picture height, pixels.
    pub height: u32,
    /// Tiles per row.
    pub tiles_x: u32,
    /// Rows of tiles.
    pub tiles_y: u32,
    /// Invocations that share the sorted splats among them when tiles are filled.
    pub lane_count: u32,
    /// Entries the tile lists have room for.
    pub pair_capacity: u32,
}

/// A Gaussian as one view sees it, 32 bytes; `Splat` in `shaders/frame.glsl`, written and read by the GPU alone.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Splat {
    /// Centre in the image, pixels from the left edge.
    pub mean_x: f32,
    /// Centre in the image, pixels from the top edge.
    pub mean_y: f32,
    /// Root of the inverse covariance, scaled so that squares are in units of log2.
    pub ux: f32,
    /// As `ux`, for the vertical offset.
    pub uy: f32,
    /// As `ux`, second row: reads the vertical offset alone.
    pub wy: f32,
    /// Logarithm to base 2 of the opacity.
    pub log2_opacity: f32,
    /// Red and green as two halves.
    pub red_green: u32,
    /// Blue as a half in the lower 16 bits.
    pub blue: u32,
}
