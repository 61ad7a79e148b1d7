//! Draws 3D Gaussians with Vulkan: posing, projection, sort, two back ends, read-back.
//!
//! This crate knows Gaussians, not people. [`Gpu::open`](renderer_vulkan::gpu::Gpu::open) picks a device,
//! [`SplatRenderer`](renderer::SplatRenderer) turns a foreground of [`PackedGaussian`](gaussian::PackedGaussian)s, a static
//! [`Background`](background::Background) and one or two [`Camera`](camera::Camera)s into pictures with premultiplied alpha and
//! depth. It needs Vulkan 1.1 with subgroup operations and runs on software drivers (Mesa's lavapipe) as on GPUs.

pub mod back_ends;
pub mod background;
pub mod camera;
pub mod drawing;
mod engine;
pub mod error;
pub mod external_images;
mod geometry_pass;
pub mod interrupt;
pub mod limits;
pub mod motion_bound;
pub mod options;
mod order;
mod parts;
pub mod picture;
pub mod posing;
pub mod quad_pass;
mod quads;
mod read_back;
pub mod renderer;
mod scan;
mod shared_buffers;
pub mod slot;
pub mod sort;
pub mod target;
#[cfg(test)]
mod testing;
mod tiles;
pub mod times;
pub mod window;

/// Gaussians as they are given to the renderer, and packed as it draws them.
pub mod gaussian {
    pub use shaders_spirv::{Gaussian, PackedGaussian};
}
