//! Draws 3D Gaussians with Vulkan: posing, projection, sort, two back ends, read-back, windows.
//!
//! This crate knows Gaussians, not people. [`Gpu::open`](renderer_vulkan::gpu::Gpu::open) picks a device;
//! [`SplatRenderer`](renderer::SplatRenderer) turns a foreground of [`PackedGaussian`](gaussian::PackedGaussian)s, a static
//! [`Background`](background::Background) and one or two [`Camera`](camera::Camera)s into pictures with premultiplied alpha and
//! depth. It needs Vulkan 1.1 with subgroup operations and runs on software drivers (Mesa's lavapipe) as on GPUs.
//!
//! A scene from a file, as a PNG (`examples/splat.rs` is the same as a program):
//!
//! ```no_run
//! use std::sync::Arc;
//!
//! use glam::Vec3;
//! use renderer_splat::background::Background;
//! use renderer_splat::camera::Camera;
//! use renderer_splat::options::RendererOptions;
//! use renderer_splat::picture::Backdrop;
//! use renderer_splat::renderer::SplatRenderer;
//! use renderer_vulkan::choice::GpuChoice;
//! use renderer_vulkan::gpu::Gpu;
//! use splat_scene::Scene;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = Scene::load("scene.ply")?;
//! let (width, height) = (1280, 720);
//! let options = RendererOptions {
//!     background: Some(Arc::new(Background::pack(&scene))),
//!     ..RendererOptions::new(0, width, height, 1)
//! };
//! let gpu = Gpu::open(&GpuChoice::Auto, false)?;
//! let mut renderer = SplatRenderer::new(gpu, &options)?;
//! let eye = Vec3::new(0.0, 1.5, 3.0);
//! renderer.draw(&[Camera::look_at(eye, Vec3::ZERO, Vec3::Y, 0.8, width, height)])?;
//! let rgb = renderer.read_back(0)?.over(Backdrop::Colour([0.0; 3]));
//! image::save_buffer("out.png", &rgb, width, height, image::ExtendedColorType::Rgb8)?;
//! # Ok(())
//! # }
//! ```
//!
//! The path of a picture: [`renderer`] (the public API), `engine` (the order of the stages on one device), `geometry_pass` (upload, [`posing`],
//! projection, [`sort`]), [`back_ends`] (`tiles` or `quads`), then `read_back` ([`lists`] beside it, for counting work), a [`window`], or [`external_images`] such as a
//! headset's.

pub mod back_ends;
pub mod background;
pub mod camera;
mod cost;
pub mod drawing;
mod engine;
pub mod error;
pub mod external_images;
mod geometry_pass;
pub mod host_picture;
pub mod interrupt;
pub mod limits;
pub mod lists;
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
pub mod visible_tiles;
pub mod window;

/// Gaussians as they are given to the renderer, and packed as it draws them.
pub mod gaussian {
    pub use shaders_spirv::{ALPHA_CUT, Gaussian, PackedGaussian};
}
