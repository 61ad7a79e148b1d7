//! Bringing a finished picture to the host.

use std::sync::Arc;

use ash::vk;
use half::slice::HalfFloatSliceExt;

use crate::buffer::{Buffer, Place};
use crate::commands::{Commands, barrier};
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::picture::Image;
use crate::target::{Pixel, Target};

/// A host-visible copy of one layer of a target.
pub(crate) struct ReadBack {
    buffer: Buffer,
}

impl ReadBack {
    pub(crate) fn new(gpu: &Arc<Gpu>, target: &Target) -> Result<Self, RenderError> {
        let usage = vk::BufferUsageFlags::empty();
        Ok(Self {
            buffer: Buffer::new(
                gpu,
                "picture read-back",
                target.layer_bytes(),
                usage,
                Place::ReadBack,
            )?,
        })
    }

    /// Copies one layer to the host. The layer exists, its picture is finished.
    pub(crate) fn read(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        target: &Target,
        layer: u32,
    ) -> Result<Image, RenderError> {
        let bytes = target.layer_bytes();
        let region = [vk::BufferCopy {
            src_offset: u64::from(layer) * bytes,
            dst_offset: 0,
            size: bytes,
        }];
        commands.run("the read-back", |commands| {
            // SAFETY: the layer lies in the target, and the read-back buffer holds one.
            unsafe {
                gpu.device().cmd_copy_buffer(
                    commands,
                    target.buffer.handle(),
                    self.buffer.handle(),
                    &region,
                );
            }
            barrier(gpu, commands);
        })?;
        let count = target.width as usize * target.height as usize;
        let halves: Vec<Pixel> = self.buffer.read(count);
        let mut pixels = vec![[0.0f32; 4]; count];
        halves
            .as_flattened()
            .convert_to_f32_slice(pixels.as_flattened_mut());
        Ok(Image::new(target.width, target.height, pixels)
            .unwrap_or_else(|| unreachable!("the buffer holds as many pixels as the target")))
    }
}
