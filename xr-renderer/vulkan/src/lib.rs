//! A thin Vulkan layer: device, memory, buffers, commands, pipelines, windows. It knows no Gaussians.

pub mod advice;
pub mod attachment;
mod bandwidth;
pub mod bindings;
pub mod buffer;
mod calibration;
pub mod choice;
pub mod clock;
pub mod commands;
pub mod error;
pub mod factory;
pub mod gpu;
pub mod graphics;
mod instance;
mod memory;
pub mod physical;
pub mod pipeline;
pub mod render_pass;
pub mod surface;
pub mod swapchain;
#[cfg(test)]
mod testing;
pub mod timestamps;
pub mod upload;
mod validation;
