//! A Gaussian as the GPU reads it.

use bytemuck::{Pod, Zeroable};

/// One Gaussian in world space, 64 bytes; `PackedGaussian` in `shaders/project.comp`.
///
/// Values are already activated: an avatar's opacity logit has been through the sigmoid, its log-scale
/// through `exp`, its colour coefficient through `0.5 + 0.2821 c` (spherical harmonics of degree 0).
/// The renderer drops a Gaussian with a non-finite value, and one that nothing could see.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PackedGaussian {
    /// World position, metres.
    pub position: [f32; 3],
    /// Opacity at the centre, 0..=1.
    pub opacity: f32,
    /// Unit quaternion x, y, z, w: world from the Gaussian's own axes.
    pub rotation: [f32; 4],
    /// Standard deviation along each own axis, metres.
    pub scale: [f32; 3],
    /// Not read.
    pub padding_0: f32,
    /// Display colour, red, green, blue. May leave 0..=1: below 0 is drawn as 0 (as 3DGS does), above 1 is kept.
    pub colour: [f32; 3],
    /// Not read.
    pub padding_1: f32,
}

impl PackedGaussian {
    /// A Gaussian from its activated values; see the fields for units.
    pub const fn new(
        position: [f32; 3],
        rotation: [f32; 4],
        scale: [f32; 3],
        opacity: f32,
        colour: [f32; 3],
    ) -> Self {
        Self {
            position,
            opacity,
            rotation,
            scale,
            padding_0: 0.0,
            colour,
            padding_1: 0.0,
        }
    }
}
