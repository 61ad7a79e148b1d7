//! Bringing a finished picture to the host.

use std::sync::Arc;

use ash::vk;
use half::f16;
use half::slice::HalfFloatSliceExt;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::commands::{Commands, barrier};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;

use crate::picture::Image;
use crate::target::{Pixel, Target};

/// A host-visible copy of one layer of a target, its colours or its depths.
pub(crate) struct ReadBack {
    buffer: Buffer,
}

impl ReadBack {
    pub(crate) fn new(gpu: &Arc<Gpu>, target: &Target) -> Result<Self, VulkanError> {
        let usage = vk::BufferUsageFlags::empty();
        Ok(Self {
            buffer: Buffer::new(
                gpu,
                "picture read-back",
                target.layer_bytes().max(target.depth_layer_bytes()),
                usage,
                MemoryUsage::ReadBack,
            )?,
        })
    }

    /// Copies one layer's colours to the host. The layer exists, its picture is finished.
    pub(crate) fn read(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        target: &Target,
        layer: u32,
    ) -> Result<Image, VulkanError> {
        self.copy(gpu, commands, &target.buffer, target.layer_bytes(), layer)?;
        let count = target.width as usize * target.height as usize;
        let halves: Vec<Pixel> = self.buffer.read(count);
        let mut pixels = vec![[0.0f32; 4]; count];
        halves
            .as_flattened()
            .convert_to_f32_slice(pixels.as_flattened_mut());
        Ok(Image::new(target.width, target.height, pixels)
            .unwrap_or_else(|| unreachable!("the buffer holds as many pixels as the target")))
    }

    /// Copies one layer's depths to the host, row by row.
    pub(crate) fn read_depth(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        target: &Target,
        layer: u32,
    ) -> Result<Vec<f32>, VulkanError> {
        self.copy(
            gpu,
            commands,
            &target.depth,
            target.depth_layer_bytes(),
            layer,
        )?;
        let (stride, width) = (target.depth_stride() as usize, target.width as usize);
        let halves: Vec<f16> = self.buffer.read(stride * target.height as usize);
        let rows = halves.chunks_exact(stride);
        Ok(rows
            .flat_map(|row| row.iter().take(width).map(|half| half.to_f32()))
            .collect())
    }

    fn copy(
        &self,
        gpu: &Gpu,
        commands: &mut Commands,
        from: &Buffer,
        layer_bytes: u64,
        layer: u32,
    ) -> Result<(), VulkanError> {
        let region = [vk::BufferCopy {
            src_offset: u64::from(layer) * layer_bytes,
            dst_offset: 0,
            size: layer_bytes,
        }];
        commands.run("the read-back", |commands| {
            // SAFETY: the layer lies in the source, and the read-back buffer holds one of either kind.
            unsafe {
                let device = gpu.device();
                device.cmd_copy_buffer(commands, from.handle(), self.buffer.handle(), &region);
            }
            barrier(gpu, commands);
        })
    }
}
