//! The buffers that the passes of a picture share.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::{FrameParams, Splat};

use crate::sort::SortPasses;

/// The buffers that the passes write for one another and for the back ends.
pub(crate) struct SharedBuffers {
    /// Cameras and sizes, as all stages read them.
    pub(crate) frame: Buffer,
    /// The splats of the left (or only) view and of the right one; the latter tiny where there is none.
    pub(crate) splats: [Buffer; 2],
    /// Tiles each splat touches, view after view.
    pub(crate) rects: Buffer,
    /// A [`SortState`](shaders_spirv::SortState).
    pub(crate) state: Buffer,
    pub(crate) depths: Buffer,
    pub(crate) items: Buffer,
}

impl SharedBuffers {
    pub(crate) fn new(gpu: &Arc<Gpu>, capacity: u32, views: u32) -> Result<Self, VulkanError> {
        let each = |size: usize| u64::from(capacity) * size as u64;
        let uniform = vk::BufferUsageFlags::UNIFORM_BUFFER;
        let bytes = size_of::<FrameParams>() as u64;
        let right = if views > 1 {
            each(size_of::<Splat>())
        } else {
            0
        };
        Ok(Self {
            frame: Buffer::new(gpu, "cameras", bytes, uniform, MemoryUsage::Upload)?,
            splats: [
                Buffer::storage(gpu, "projected splats", each(size_of::<Splat>()))?,
                Buffer::storage(gpu, "projected splats", right)?,
            ],
            rects: Buffer::storage(gpu, "splat rectangles", each(4) * u64::from(views))?,
            state: SortPasses::state_buffer(gpu)?,
            depths: Buffer::storage(gpu, "depths", each(4))?,
            items: Buffer::storage(gpu, "visible Gaussians", each(4))?,
        })
    }

    /// What `shaders/project.glsl` binds, and `more` after it.
    pub(crate) fn projecting<'a>(&'a self, more: &[&'a Buffer]) -> Vec<Resource<'a>> {
        let [left, right] = &self.splats;
        let storage = [
            left,
            right,
            &self.rects,
            &self.depths,
            &self.items,
            &self.state,
        ];
        let storage = storage.into_iter().chain(more.iter().copied());
        std::iter::once(Resource::Uniform(&self.frame))
            .chain(storage.map(Resource::Storage))
            .collect()
    }
}
