//! A picture that the host made, where windows can show it.

use std::sync::Arc;

use ash::vk;
use half::f16;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;

use crate::target::Pixel;

/// An opaque picture in memory that the device reads, for [`WindowTarget::present_picture`](crate::window::WindowTarget::present_picture).
#[derive(Debug)]
pub struct HostPicture {
    pub(crate) pixels: Buffer,
    pub(crate) width: u32,
    pub(crate) height: u32,
    staged: Vec<Pixel>,
    /// The half float of each byte.
    halves: Box<[f16]>,
}

impl HostPicture {
    /// A black picture of that size, pixels.
    ///
    /// # Errors
    /// Too little memory, or a device that fails.
    pub fn new(gpu: &Arc<Gpu>, width: u32, height: u32) -> Result<Self, VulkanError> {
        let (width, height) = (width.max(1), height.max(1));
        let black = [f16::ZERO, f16::ZERO, f16::ZERO, f16::ONE];
        let staged = vec![black; width as usize * height as usize];
        let mut pixels = Buffer::new(
            gpu,
            "a picture of the host's",
            size_of_val(&staged[..]) as u64,
            vk::BufferUsageFlags::STORAGE_BUFFER,
            MemoryUsage::Upload,
        )?;
        pixels.write(&staged);
        Ok(Self {
            pixels,
            width,
            height,
            staged,
            halves: (0..=u8::MAX)
                .map(|value| f16::from_f32(f32::from(value) / 255.0))
                .collect(),
        })
    }

    /// Width and height, pixels.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Writes `rgb`, three bytes a pixel as they are displayed, rows from the top. Pixels that are missing stay as they were, those that
    /// are too many are left out. No window is showing the picture meanwhile: [`WindowTarget`](crate::window::WindowTarget) waits for
    /// its last picture before it takes the next.
    pub fn write(&mut self, rgb: &[u8]) {
        let half = |value: u8| self.halves[usize::from(value)];
        for (pixel, [r, g, b]) in self.staged.iter_mut().zip(rgb.as_chunks().0) {
            *pixel = [half(*r), half(*g), half(*b), f16::ONE];
        }
        self.pixels.write(&self.staged);
    }
}
