//! Splatting that can be learnt through, on any Vulkan device: what `splat-gradient` does on the CPU, behind the same interface.
//!
//! [`VulkanSplatter`] projects, sorts, lists splats by tiles, blends, and takes derivatives back, all in compute shaders: Gaussians and derivatives
//! by pixels go up, the picture and derivatives by Gaussians come down. Depths are sorted by the renderer's own shaders. Each pair of tile and
//! splat has a place of its own for what it gathers, and each Gaussian's places are added up in their order: no float is added atomically, so that a
//! device gives the same bytes each time. Pictures and derivatives are the CPU's but for rounding, and but for a pixel that is just at a cut or two splats that are just as deep.

mod buffers;
mod pass;
mod passes;
mod shaders {
    include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
}
mod sort;
mod splatter;

pub use splatter::VulkanSplatter;
