//! A compute shader with the buffers that it reads and writes, and prefix sums.

use crate::buffers::Buffers;
use ash::vk;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::commands::barrier;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};
use shaders_spirv::{SCAN_APPLY, SCAN_BLOCK, SCAN_BLOCKS};
use std::sync::Arc;

/// Which buffers a shader binds, in the order of their numbers.
type Resources = for<'a> fn(&'a Buffers) -> Vec<Resource<'a>>;

/// A compute shader, bound to its buffers.
#[derive(Debug)]
pub(crate) struct Pass {
    pipeline: ComputePipeline,
    resources: Resources,
}

impl Pass {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        words: &[u32],
        constants: &[u32],
        push_bytes: u32,
        resources: Resources,
        buffers: &Buffers,
    ) -> Result<Self, VulkanError> {
        let specialisation = Specialisation {
            constants,
            push_bytes,
            ..Default::default()
        };
        let bound = resources(buffers);
        Ok(Self {
            pipeline: ComputePipeline::new(gpu, words, specialisation, &bound)?,
            resources,
        })
    }

    /// Binds other buffers, which outlive the pass' next use. The device is not using it.
    pub(crate) fn bind(&mut self, buffers: &Buffers) {
        self.pipeline.bind(&(self.resources)(buffers));
    }

    pub(crate) fn dispatch(&self, commands: vk::CommandBuffer, push: &[u32], groups: [u32; 3]) {
        self.pipeline.dispatch(commands, push, groups);
    }

    pub(crate) fn dispatch_indirect(&self, commands: vk::CommandBuffer, by: &Buffer, offset: u64) {
        self.pipeline.dispatch_indirect(commands, by, offset);
    }
}

/// Which buffer a prefix sum is taken of.
type Elements = fn(&Buffers) -> &Buffer;

/// The exclusive prefix sum of a buffer's numbers, in place; by the renderer's shaders.
#[derive(Debug)]
pub(crate) struct Scan {
    passes: [ComputePipeline; 2],
    elements: Elements,
}

impl Scan {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        elements: Elements,
        buffers: &Buffers,
    ) -> Result<Self, VulkanError> {
        let resources = [elements(buffers), &buffers.block_sums].map(Resource::Storage);
        let specialisation = Specialisation {
            push_bytes: 4,
            ..Default::default()
        };
        let make = |words| ComputePipeline::new(gpu, words, specialisation, &resources);
        Ok(Self {
            passes: [make(SCAN_BLOCKS.words)?, make(SCAN_APPLY.words)?],
            elements,
        })
    }

    pub(crate) fn bind(&mut self, buffers: &Buffers) {
        let resources = [(self.elements)(buffers), &buffers.block_sums].map(Resource::Storage);
        for pass in &mut self.passes {
            pass.bind(&resources);
        }
    }

    /// Records the sum of the first `count`; what it reads must be visible, what it wrote is made so.
    pub(crate) fn record(&self, gpu: &Gpu, commands: vk::CommandBuffer, count: u32) {
        for pass in &self.passes {
            pass.dispatch(commands, &[count], [count.div_ceil(SCAN_BLOCK), 1, 1]);
            barrier(gpu, commands);
        }
    }
}
