//! The picture on the device: one layer per view, premultiplied RGBA and premultiplied depth in half floats.
//!
//! Buffers, which every driver writes well from compute; presenting copies them to an image. A picture may be smaller than the
//! buffers: it then lies at their start, without gaps.

use std::sync::Arc;

use ash::vk;
use half::f16;
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;

/// Red, green, blue, alpha: display values, premultiplied.
pub type Pixel = [f16; 4];

/// The picture that a back end writes and copies read: layer by layer, row by row from the top.
#[derive(Debug)]
pub struct Target {
    /// Its colours: a [`Pixel`] each.
    pub buffer: Buffer,
    /// Depth in metres times alpha, [`Self::depth_stride`] in a row.
    pub depth: Buffer,
    /// Width of the picture that is drawn, pixels.
    pub width: u32,
    /// Height of the picture that is drawn, pixels.
    pub height: u32,
    /// The largest size that fits.
    pub most: vk::Extent2D,
    /// Views, one after the other.
    pub layers: u32,
    has_depth: bool,
}

impl Target {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        width: u32,
        height: u32,
        layers: u32,
        has_depth: bool,
    ) -> Result<Self, VulkanError> {
        let rows = u64::from(height) * u64::from(layers);
        let bytes = rows * u64::from(width) * size_of::<Pixel>() as u64;
        let depth_rows = if has_depth { rows } else { 0 };
        let depth_bytes = depth_rows * u64::from(depth_stride(width)) * size_of::<f16>() as u64;
        Ok(Self {
            buffer: Buffer::storage(gpu, "the picture", bytes)?,
            depth: Buffer::storage(gpu, "the picture's depth", depth_bytes)?,
            width,
            height,
            most: vk::Extent2D { width, height },
            layers,
            has_depth,
        })
    }

    /// Takes pictures of another size, for which there is room, from now on.
    pub(crate) fn resize(&mut self, width: u32, height: u32) {
        debug_assert!(
            width <= self.most.width && height <= self.most.height,
            "no room for {width}x{height}"
        );
        (self.width, self.height) = (width, height);
    }

    /// Records that all of the picture is made transparent.
    pub(crate) fn record_clear(&self, gpu: &Gpu, commands: vk::CommandBuffer) {
        let layers = u64::from(self.layers);
        for (buffer, bytes) in [
            (&self.buffer, layers * self.layer_bytes()),
            (&self.depth, layers * self.depth_layer_bytes()),
        ] {
            // Without depths there is hardly a buffer for them, and nothing to clear.
            let bytes = bytes.min(buffer.size());
            // SAFETY: the command buffer is being recorded; the buffer can be a copy's target and has as many bytes,
            // which are a multiple of 4 and more than none.
            unsafe {
                let device = gpu.device();
                device.cmd_fill_buffer(commands, buffer.handle(), 0, bytes, 0);
            }
        }
    }

    /// Whether depths are drawn; without them their buffer is almost empty.
    pub fn has_depth(&self) -> bool {
        self.has_depth
    }

    /// Bytes of one layer's colours.
    pub(crate) fn layer_bytes(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height) * size_of::<Pixel>() as u64
    }

    /// Depths in a row: even, since they are written in pairs.
    pub fn depth_stride(&self) -> u32 {
        depth_stride(self.width)
    }

    /// Bytes of one layer's depths.
    pub(crate) fn depth_layer_bytes(&self) -> u64 {
        u64::from(self.depth_stride()) * u64::from(self.height) * size_of::<f16>() as u64
    }
}

fn depth_stride(width: u32) -> u32 {
    width.next_multiple_of(2)
}
