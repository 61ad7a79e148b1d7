//! Shader sources compiled to SPIR-V at build time, and the structs they share with Rust.
//!
//! The GLSL lies in `shaders/`; `build.rs` compiles it with glslang. This crate starts no device and
//! knows no Vulkan handle: `xr-renderer` makes pipelines of what is here.

mod frame;
mod gaussian;

pub use frame::{FrameParams, Splat, ViewParams};
pub use gaussian::PackedGaussian;

/// One compiled shader. Its entry point is `main`.
#[derive(Debug, Clone, Copy)]
pub struct Shader {
    /// File name without its extension.
    pub name: &'static str,
    /// SPIR-V 1.3 for Vulkan 1.1.
    pub words: &'static [u32],
}

/// Side of a screen tile in pixels; `TILE` in `shaders/frame.glsl`.
pub const TILE_PIXELS: u32 = 16;

/// Elements one workgroup of the prefix sum takes; `BLOCK` in `shaders/scan.glsl`.
pub const SCAN_BLOCK: u32 = 1024;

/// A value that the sort leaves out; `DROPPED` in `shaders/frame.glsl`, `DROPPED_VALUE` in `sort.glsl`.
pub const DROPPED: u32 = u32::MAX;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
