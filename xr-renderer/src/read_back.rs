//! Bringing a finished picture to the host.

use std::sync::Arc;

use ash::vk;
use half::f16;
use half::slice::HalfFloatSliceExt;

use crate::buffer::{Buffer, Place};
use crate::commands::{Commands, barrier};
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::picture::Image;
use crate::target::Target;

/// A host-visible copy of one layer of a target.
pub(crate) struct ReadBack {
    buffer: Buffer,
}

impl ReadBack {
    pub(crate) fn new(gpu: &Arc<Gpu>, target: &Target) -> Result<Self, RenderError> {
        let bytes = u64::from(target.width) * u64::from(target.height) * 8;
        let usage = vk::BufferUsageFlags::empty();
        Ok(Self { buffer: Buffer::new(gpu, "picture read-back", bytes, usage, Place::ReadBack)? })
    }

    /// Copies one layer to the host. The target holds a finished picture in `GENERAL` layout.
    pub(crate) fn read(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        target: &Target,
        layer: u32,
    ) -> Result<Image, RenderError> {
        let region = [vk::BufferImageCopy::default()
            .image_subresource(target.layer(layer))
            .image_extent(target.extent())];
        commands.run("the read-back", |commands| {
            // SAFETY: the buffer holds a layer, which exists and is in the named layout.
            unsafe {
                gpu.device().cmd_copy_image_to_buffer(
                    commands,
                    target.image(),
                    vk::ImageLayout::GENERAL,
                    self.buffer.handle(),
                    &region,
                );
            }
            barrier(gpu, commands);
        })?;
        let count = target.width as usize * target.height as usize;
        let halves: Vec<[f16; 4]> = self.buffer.read(count);
        let mut pixels = vec![[0.0f32; 4]; count];
        halves.as_flattened().convert_to_f32_slice(pixels.as_flattened_mut());
        Ok(Image::new(target.width, target.height, pixels)
            .unwrap_or_else(|| unreachable!("the buffer holds as many pixels as the target")))
    }
}
