//! The parameters of the shaders that make a headset compositor's pictures. Offsets are checked against the compiled shaders in
//! `tests/layout.rs`.

use bytemuck::{Pod, Zeroable};

use crate::frame::VisibleRows;

/// An eye's pose, and the ray through each of its pixels; `EyeView` in `shaders/eye.glsl` (std140).
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct EyeView {
    /// Rows of the 3x4 rigid transform, metres; the eye looks along its -z, y up.
    pub world_from_eye: [[f32; 4]; 3],
    /// `x/-z` of the left edge, `y/-z` of the upper edge, and their steps from pixel to pixel.
    pub slopes: [f32; 4],
}

/// Both eyes, and the form in which their compositor takes pictures; `EyeParams` in `shaders/eye.glsl` (std140).
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct EyeParams {
    /// Left and right.
    pub views: [EyeView; 2],
    /// Picture width, pixels.
    pub width: u32,
    /// Picture height, pixels.
    pub height: u32,
    /// Halves in a row of the depths' buffer; 0 without depth.
    pub depth_stride: u32,
    /// What surrounds the people: 0 for the viewer's room, 1 for a studio, 2 for darkness.
    pub surround: u32,
    /// 1 where bytes go blue first.
    pub swaps_red: u32,
    /// 1 where the compositor takes the bytes for linear light.
    pub linear: u32,
    /// Depth 0 for the compositor, metres.
    pub near: f32,
    /// Depth 1 for the compositor, metres.
    pub far: f32,
    /// Rows of tiles in one strip of the picture, as it is shown by `shaders/show_eye.vert`.
    pub strip_rows: u32,
    /// Nothing: `std140` puts arrays at multiples of 16 bytes.
    pub padding: [u32; 3],
    /// What anyone sees of each row of tiles.
    pub visible_rows: VisibleRows,
}
