//! A thin Vulkan layer: instance and device, memory, buffers, commands, pipelines, timestamps, windows.
//!
//! It has what is the same in every Vulkan program, and does not know what is drawn. [`gpu::Gpu::open`] picks a device
//! (or [`gpu::Gpu::open_with`], where a headset's runtime makes it). Every object holds an `Arc` of its device and frees itself.
//!
//! It is no safe wrapper. What is recorded into a command buffer, by ash's functions or by those called `record_...` here, is the
//! caller's responsibility, as in Vulkan itself; so is waiting for the device before an object that it uses is dropped, which
//! [`commands::Commands`] does when it is dropped first.
//!
//! ```no_run
//! use ash::vk;
//! use renderer_vulkan::buffer::{Buffer, MemoryUsage};
//! use renderer_vulkan::choice::GpuChoice;
//! use renderer_vulkan::commands::{Commands, barrier};
//! use renderer_vulkan::gpu::Gpu;
//!
//! # fn main() -> Result<(), renderer_vulkan::error::VulkanError> {
//! let gpu = Gpu::open(&GpuChoice::Auto, false)?;
//! println!("{}", gpu.info().name);
//! let numbers = Buffer::storage(&gpu, "numbers", 1024)?;
//! let usage = vk::BufferUsageFlags::empty();
//! let read_back = Buffer::new(&gpu, "read back", 1024, usage, MemoryUsage::ReadBack)?;
//! let mut commands = Commands::new(&gpu)?;
//! commands.run("a fill", |commands| {
//!     // SAFETY: the command buffer is being recorded, and the buffer may be filled.
//!     unsafe {
//!         let device = gpu.device();
//!         device.cmd_fill_buffer(commands, numbers.handle(), 0, vk::WHOLE_SIZE, 7);
//!     }
//!     barrier(&gpu, commands);
//!     numbers.record_copy(commands, &read_back, 1024);
//!     barrier(&gpu, commands);
//! })?;
//! assert_eq!(read_back.read::<u32>(256), [7; 256]);
//! # Ok(())
//! # }
//! ```

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
