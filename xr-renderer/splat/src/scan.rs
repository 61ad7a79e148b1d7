//! Exclusive prefix sum of a buffer of `u32`, in place, saturating.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::commands::barrier;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};
use shaders_spirv::SCAN_BLOCK;

/// The two passes over one buffer.
pub(crate) struct Scan {
    gpu: Arc<Gpu>,
    blocks: ComputePipeline,
    apply: ComputePipeline,
    count: u32,
    _block_sums: Buffer,
}

impl Scan {
    /// A sum over the first `count` elements; the buffer outlives the scan's use.
    pub(crate) fn new(gpu: &Arc<Gpu>, elements: &Buffer, count: u32) -> Result<Self, VulkanError> {
        let sums = u64::from(count.div_ceil(SCAN_BLOCK)) * 4;
        let block_sums = Buffer::storage(gpu, "prefix sums", sums)?;
        let resources = [Resource::Storage(elements), Resource::Storage(&block_sums)];
        let specialisation = Specialisation {
            push_bytes: 4,
            ..Default::default()
        };
        let make = |shader| ComputePipeline::new(gpu, shader, specialisation, &resources);
        Ok(Self {
            gpu: Arc::clone(gpu),
            blocks: make(shaders_spirv::SCAN_BLOCKS.words)?,
            apply: make(shaders_spirv::SCAN_APPLY.words)?,
            count,
            _block_sums: block_sums,
        })
    }

    /// Records the sum; what it reads must be visible, what it wrote is made so.
    pub(crate) fn record(&self, commands: vk::CommandBuffer) {
        let groups = [self.count.div_ceil(SCAN_BLOCK), 1, 1];
        self.blocks.dispatch(commands, &[self.count], groups);
        barrier(&self.gpu, commands);
        self.apply.dispatch(commands, &[self.count], groups);
        barrier(&self.gpu, commands);
    }
}
