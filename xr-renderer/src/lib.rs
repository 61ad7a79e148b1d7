//! Draws 3D Gaussians with Vulkan: device, sort, tile rasteriser, read-back.
//!
//! This crate knows Gaussians, not people. [`Gpu::open`] picks a device, [`SplatRenderer`] turns
//! [`PackedGaussian`]s and one or two [`Camera`]s into pictures with premultiplied alpha. It needs Vulkan
//! 1.1 with subgroup operations and runs on software drivers (Mesa's lavapipe) as on GPUs.

mod buffer;
mod camera;
mod choice;
mod commands;
mod error;
mod front;
mod gpu;
mod instance;
mod physical;
mod picture;
mod pipeline;
mod present;
mod read_back;
mod scan;
mod sort;
mod splat;
mod surface;
mod swapchain;
mod target;
mod tiles;
mod timestamps;
mod validation;

pub use camera::{Camera, Fov};
pub use choice::GpuChoice;
pub use error::RenderError;
pub use gpu::Gpu;
pub use physical::DeviceInfo;
pub use picture::{Background, Image};
pub use present::{Shown, WindowTarget};
pub use shaders_spirv::PackedGaussian;
pub use sort::Sorter;
pub use splat::SplatRenderer;
pub use timestamps::StageTimes;
