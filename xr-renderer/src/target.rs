//! The picture on the device: one layer per view, premultiplied RGBA in half floats.
//!
//! It is a buffer, which every driver writes well from compute; whoever shows it copies it to an image.

use std::sync::Arc;

use half::f16;

use crate::buffer::Buffer;
use crate::error::RenderError;
use crate::gpu::Gpu;

/// Red, green, blue, alpha: display values, premultiplied.
pub(crate) type Pixel = [f16; 4];

/// What the raster pass writes and copies read: layer by layer, row by row from the top.
pub(crate) struct Target {
    pub(crate) buffer: Buffer,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) layers: u32,
}

impl Target {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        width: u32,
        height: u32,
        layers: u32,
    ) -> Result<Self, RenderError> {
        let layer = layer_bytes(width, height);
        let buffer = Buffer::storage(gpu, "the picture", layer * u64::from(layers))?;
        Ok(Self {
            buffer,
            width,
            height,
            layers,
        })
    }

    /// Bytes of one layer.
    pub(crate) fn layer_bytes(&self) -> u64 {
        layer_bytes(self.width, self.height)
    }
}

fn layer_bytes(width: u32, height: u32) -> u64 {
    u64::from(width) * u64::from(height) * size_of::<Pixel>() as u64
}
