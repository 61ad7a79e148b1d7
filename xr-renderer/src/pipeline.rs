//! A compute pipeline with the one descriptor set it reads.

use std::sync::Arc;

use ash::vk;
use shaders_spirv::Shader;

use crate::buffer::Buffer;
use crate::error::{RenderError, VkContext};
use crate::gpu::Gpu;

/// Something a shader binds; its place in the list is its binding number.
#[derive(Clone, Copy)]
pub(crate) enum Resource<'a> {
    Storage(&'a Buffer),
    Uniform(&'a Buffer),
}

impl Resource<'_> {
    fn kind(&self) -> vk::DescriptorType {
        match self {
            Self::Storage(_) => vk::DescriptorType::STORAGE_BUFFER,
            Self::Uniform(_) => vk::DescriptorType::UNIFORM_BUFFER,
        }
    }
}

/// How a shader is specialised.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Specialisation<'a> {
    /// Values of `constant_id` 0, 1, ...
    pub(crate) constants: &'a [u32],
    /// Bytes of push constants.
    pub(crate) push_bytes: u32,
    /// Whether the shader is written for subgroups of exactly the device's size, all full.
    pub(crate) fixed_subgroups: bool,
}

/// A shader made ready, with its resources bound.
pub(crate) struct ComputePipeline {
    gpu: Arc<Gpu>,
    set_layout: vk::DescriptorSetLayout,
    layout: vk::PipelineLayout,
    pipeline: vk::Pipeline,
    pool: vk::DescriptorPool,
    set: vk::DescriptorSet,
}

impl ComputePipeline {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        shader: Shader,
        specialisation: Specialisation<'_>,
        resources: &[Resource<'_>],
    ) -> Result<Self, RenderError> {
        let mut made = Self {
            gpu: Arc::clone(gpu),
            set_layout: vk::DescriptorSetLayout::null(),
            layout: vk::PipelineLayout::null(),
            pipeline: vk::Pipeline::null(),
            pool: vk::DescriptorPool::null(),
            set: vk::DescriptorSet::null(),
        };
        made.make_layout(specialisation.push_bytes, resources)?;
        made.make_pipeline(shader, specialisation)?;
        made.make_set(resources)?;
        made.bind(resources);
        Ok(made)
    }

    fn make_layout(
        &mut self,
        push_bytes: u32,
        resources: &[Resource<'_>],
    ) -> Result<(), RenderError> {
        let device = self.gpu.device();
        let bindings: Vec<_> = (0..)
            .zip(resources)
            .map(|(binding, resource)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(resource.kind())
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the structure is complete.
        self.set_layout = unsafe { device.create_descriptor_set_layout(&info, None) }
            .during("vkCreateDescriptorSetLayout")?;
        let layouts = [self.set_layout];
        let ranges = [vk::PushConstantRange {
            stage_flags: vk::ShaderStageFlags::COMPUTE,
            offset: 0,
            size: push_bytes,
        }];
        let mut info = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts);
        if push_bytes > 0 {
            info = info.push_constant_ranges(&ranges);
        }
        // SAFETY: the set layout is alive.
        self.layout = unsafe { device.create_pipeline_layout(&info, None) }
            .during("vkCreatePipelineLayout")?;
        Ok(())
    }

    fn make_pipeline(
        &mut self,
        shader: Shader,
        specialisation: Specialisation<'_>,
    ) -> Result<(), RenderError> {
        let device = self.gpu.device();
        let module = Module::new(&self.gpu, shader)?;
        let entries: Vec<_> = (0u32..)
            .zip(specialisation.constants)
            .map(|(id, _)| vk::SpecializationMapEntry {
                constant_id: id,
                offset: id * 4,
                size: 4,
            })
            .collect();
        let constants = vk::SpecializationInfo::default()
            .map_entries(&entries)
            .data(bytemuck::cast_slice(specialisation.constants));
        let mut required = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default()
            .required_subgroup_size(self.gpu.subgroup.size);
        let mut stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module.handle)
            .name(c"main")
            .specialization_info(&constants);
        if specialisation.fixed_subgroups && self.gpu.subgroup.can_be_required {
            stage = stage
                .flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS)
                .push_next(&mut required);
        }
        let info = [vk::ComputePipelineCreateInfo::default()
            .stage(stage)
            .layout(self.layout)];
        // SAFETY: module, layout and specialisation live until the call returns.
        let made =
            unsafe { device.create_compute_pipelines(vk::PipelineCache::null(), &info, None) };
        let pipelines = made
            .map_err(|(_, result)| result)
            .during("vkCreateComputePipelines")?;
        self.pipeline = pipelines.first().copied().unwrap_or_default();
        Ok(())
    }

    fn make_set(&mut self, resources: &[Resource<'_>]) -> Result<(), RenderError> {
        let device = self.gpu.device();
        let sizes: Vec<_> = resources
            .iter()
            .map(|resource| vk::DescriptorPoolSize {
                ty: resource.kind(),
                descriptor_count: 1,
            })
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default()
            .max_sets(1)
            .pool_sizes(&sizes);
        // SAFETY: the structure is complete.
        self.pool = unsafe { device.create_descriptor_pool(&info, None) }
            .during("vkCreateDescriptorPool")?;
        let layouts = [self.set_layout];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(self.pool)
            .set_layouts(&layouts);
        // SAFETY: pool and layout are alive, and the pool has room for one set.
        let sets =
            unsafe { device.allocate_descriptor_sets(&info) }.during("vkAllocateDescriptorSets")?;
        self.set = sets.first().copied().unwrap_or_default();
        Ok(())
    }

    /// Binds other resources of the same kinds. The device is not using the pipeline, and the resources
    /// outlive its next use.
    pub(crate) fn bind(&mut self, resources: &[Resource<'_>]) {
        for (binding, resource) in (0..).zip(resources) {
            let (Resource::Storage(buffer) | Resource::Uniform(buffer)) = resource;
            let buffers = [vk::DescriptorBufferInfo {
                buffer: buffer.handle(),
                offset: 0,
                range: buffer.size(),
            }];
            let write = vk::WriteDescriptorSet::default()
                .dst_set(self.set)
                .dst_binding(binding)
                .descriptor_type(resource.kind())
                .buffer_info(&buffers);
            // SAFETY: the set is not in use (the caller's promise), the resources are alive.
            unsafe { self.gpu.device().update_descriptor_sets(&[write], &[]) };
        }
    }

    /// Records a dispatch of `groups` workgroups; nothing where a count is 0.
    pub(crate) fn dispatch(&self, commands: vk::CommandBuffer, push: &[u32], groups: [u32; 3]) {
        if groups.contains(&0) {
            return;
        }
        let device = self.gpu.device();
        // SAFETY: the command buffer is being recorded; set and push constants match the layout.
        unsafe {
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, self.pipeline);
            device.cmd_bind_descriptor_sets(
                commands,
                vk::PipelineBindPoint::COMPUTE,
                self.layout,
                0,
                &[self.set],
                &[],
            );
            if !push.is_empty() {
                device.cmd_push_constants(
                    commands,
                    self.layout,
                    vk::ShaderStageFlags::COMPUTE,
                    0,
                    bytemuck::cast_slice(push),
                );
            }
            device.cmd_dispatch(commands, groups[0], groups[1], groups[2]);
        }
    }
}

impl Drop for ComputePipeline {
    fn drop(&mut self) {
        let device = self.gpu.device();
        // SAFETY: owners wait for the device before they drop; destroying a null handle does nothing.
        unsafe {
            device.destroy_descriptor_pool(self.pool, None);
            device.destroy_pipeline(self.pipeline, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

/// A shader module, needed only while its pipeline is made.
struct Module<'a> {
    gpu: &'a Gpu,
    handle: vk::ShaderModule,
}

impl<'a> Module<'a> {
    fn new(gpu: &'a Gpu, shader: Shader) -> Result<Self, RenderError> {
        let info = vk::ShaderModuleCreateInfo::default().code(shader.words);
        // SAFETY: the words are SPIR-V that glslang wrote.
        let handle = unsafe { gpu.device().create_shader_module(&info, None) }
            .during("vkCreateShaderModule")?;
        Ok(Self { gpu, handle })
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: pipelines do not need their module once made.
        unsafe { self.gpu.device().destroy_shader_module(self.handle, None) };
    }
}
