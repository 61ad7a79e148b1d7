//! Shader sources compiled to SPIR-V at build time, and the structs they share with Rust.
//!
//! The GLSL lies in `shaders/`; `build.rs` compiles it with glslang. This crate starts no device and
//! knows no Vulkan handle: `renderer-splat` and `renderer-openxr` make pipelines of what is here.

#![forbid(unsafe_code)]

mod alpha_cut;
mod eye;
mod frame;
mod gaussian;
mod gaussian_lanes;

pub use alpha_cut::ALPHA_CUT;
pub use eye::{EyeParams, EyeView};
pub use frame::{FrameParams, PartParams, SortState, Splat, ViewParams};
pub use gaussian::{
    Gaussian, LOG2_MOST_SCALE, LOG2_SCALE_END, PackedGaussian, quantised, smallest_three,
};
pub use gaussian_lanes::GaussianLanes;

/// One compiled shader. Its entry point is `main`.
#[derive(Debug, Clone, Copy)]
pub struct Shader {
    /// File name without its extension.
    pub name: &'static str,
    /// SPIR-V 1.3 for Vulkan 1.1, or 1.5 for 1.2 where that is in the shader's documentation.
    pub words: &'static [u32],
}

/// Side of a screen tile in pixels; `TILE` in `shaders/frame.glsl`.
pub const TILE_PIXELS: u32 = 16;

/// Gaussians that one instance of the quad back end's draw has: as 16-bit indices reach, with six vertices each.
pub const QUADS_PER_INSTANCE: u32 = 1 << 13;

/// Elements one workgroup of the prefix sum takes; `BLOCK` in `shaders/scan.glsl`.
pub const SCAN_BLOCK: u32 = 1024;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
