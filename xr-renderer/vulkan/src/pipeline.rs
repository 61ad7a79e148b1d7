//! A compute pipeline with the resources it reads.

use std::sync::Arc;

use ash::vk;

use crate::bindings::{Bindings, Resource};
use crate::buffer::Buffer;
use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;

/// How a shader is specialised.
#[derive(Debug, Clone, Copy, Default)]
pub struct Specialisation<'a> {
    /// Values of `constant_id` 0, 1, ...
    pub constants: &'a [u32],
    /// Bytes of push constants.
    pub push_bytes: u32,
    /// Whether the shader is written for subgroups of exactly the device's size, all full.
    pub fixed_subgroups: bool,
    /// Sets of resources beside the first, for [`ComputePipeline::dispatch_with`].
    pub more_sets: u32,
}

/// A shader made ready, with its resources bound: one set of them, or several to choose from.
#[derive(Debug)]
pub struct ComputePipeline {
    gpu: Arc<Gpu>,
    bindings: Bindings,
    pipeline: vk::Pipeline,
}

impl ComputePipeline {
    /// Compiles a shader (SPIR-V, entry point `main`) whose binding numbers are the resources' places in the list.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        spirv: &[u32],
        specialisation: Specialisation<'_>,
        resources: &[Resource<'_>],
    ) -> Result<Self, VulkanError> {
        let stage = vk::ShaderStageFlags::COMPUTE;
        let Specialisation {
            push_bytes,
            more_sets,
            ..
        } = specialisation;
        let bindings = Bindings::new(gpu, stage, push_bytes, 1 + more_sets, resources)?;
        let module = Module::new(gpu, spirv)?;
        let constants = Constants::new(specialisation.constants);
        let constants = constants.info();
        let mut required = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default()
            .required_subgroup_size(gpu.subgroup.size);
        let mut stage = module
            .stage(vk::ShaderStageFlags::COMPUTE)
            .specialization_info(&constants);
        if specialisation.fixed_subgroups && gpu.subgroup.can_be_required {
            stage = stage
                .flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS)
                .push_next(&mut required);
        }
        let info = [vk::ComputePipelineCreateInfo::default()
            .stage(stage)
            .layout(bindings.layout())];
        let device = gpu.device();
        // SAFETY: module, layout and specialisation live until the call returns.
        let made =
            unsafe { device.create_compute_pipelines(vk::PipelineCache::null(), &info, None) };
        let pipelines = made
            .map_err(|(_, result)| result)
            .during("vkCreateComputePipelines")?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            bindings,
            pipeline: pipelines.first().copied().unwrap_or_default(),
        })
    }

    /// Binds other resources of the same kinds in all sets. The device is not using the pipeline, and the resources
    /// outlive its next use.
    pub fn bind(&mut self, resources: &[Resource<'_>]) {
        self.bindings.bind(resources);
    }

    /// Binds another resource of the same kind in one place of one set, under the same conditions.
    pub fn rebind(&mut self, set: usize, binding: u32, resource: Resource<'_>) {
        self.bindings.rebind(set, binding, resource);
    }

    /// Records a dispatch of `groups` workgroups; nothing where a count is 0.
    pub fn dispatch(&self, commands: vk::CommandBuffer, push: &[u32], groups: [u32; 3]) {
        self.dispatch_with(commands, 0, push, groups);
    }

    /// The same with another set of resources than the first.
    pub fn dispatch_with(
        &self,
        commands: vk::CommandBuffer,
        set: usize,
        push: &[u32],
        groups: [u32; 3],
    ) {
        if groups.contains(&0) {
            return;
        }
        self.record_bind(commands, set, push);
        // SAFETY: the command buffer is being recorded; the pipeline and its resources are bound.
        unsafe {
            let [x, y, z] = groups;
            self.gpu.device().cmd_dispatch(commands, x, y, z);
        }
    }

    /// Records a dispatch of as many workgroups as three numbers in a buffer say when it runs.
    pub fn dispatch_indirect(&self, commands: vk::CommandBuffer, groups: &Buffer, offset: u64) {
        self.record_bind(commands, 0, &[]);
        // SAFETY: as above; the buffer was made for indirect use and holds the numbers at `offset`.
        unsafe {
            let device = self.gpu.device();
            device.cmd_dispatch_indirect(commands, groups.handle(), offset);
        }
    }

    fn record_bind(&self, commands: vk::CommandBuffer, set: usize, push: &[u32]) {
        let point = vk::PipelineBindPoint::COMPUTE;
        // SAFETY: the command buffer is being recorded.
        unsafe {
            let device = self.gpu.device();
            device.cmd_bind_pipeline(commands, point, self.pipeline);
        }
        self.bindings.record(commands, point, set, push);
    }
}

impl Drop for ComputePipeline {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop.
        unsafe { self.gpu.device().destroy_pipeline(self.pipeline, None) };
    }
}

/// Specialisation constants and where each lies.
#[derive(Debug)]
pub struct Constants<'a> {
    entries: Vec<vk::SpecializationMapEntry>,
    values: &'a [u32],
}

impl<'a> Constants<'a> {
    /// Values of `constant_id` 0, 1, ...
    pub fn new(values: &'a [u32]) -> Self {
        let entry = |id: u32| vk::SpecializationMapEntry {
            constant_id: id,
            offset: id * 4,
            size: 4,
        };
        let entries = (0u32..).zip(values).map(|(id, _)| entry(id)).collect();
        Self { entries, values }
    }

    /// For a pipeline stage.
    pub fn info(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default()
            .map_entries(&self.entries)
            .data(bytemuck::cast_slice(self.values))
    }
}

/// A shader module, needed only while its pipeline is made.
#[derive(Debug)]
pub struct Module<'a> {
    gpu: &'a Gpu,
    handle: vk::ShaderModule,
}

impl<'a> Module<'a> {
    /// Of SPIR-V that is valid on this device; its entry point is `main`.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(gpu: &'a Gpu, spirv: &[u32]) -> Result<Self, VulkanError> {
        let info = vk::ShaderModuleCreateInfo::default().code(spirv);
        // SAFETY: the words are SPIR-V for a device that has what it asks for (the caller's promise).
        let handle = unsafe { gpu.device().create_shader_module(&info, None) }
            .during("vkCreateShaderModule")?;
        Ok(Self { gpu, handle })
    }

    /// The module as a pipeline's stage.
    pub fn stage(&self, stage: vk::ShaderStageFlags) -> vk::PipelineShaderStageCreateInfo<'static> {
        vk::PipelineShaderStageCreateInfo::default()
            .stage(stage)
            .module(self.handle)
            .name(c"main")
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: pipelines do not need their module once made.
        unsafe { self.gpu.device().destroy_shader_module(self.handle, None) };
    }
}
