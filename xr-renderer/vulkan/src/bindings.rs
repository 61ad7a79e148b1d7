//! The descriptor sets that a pipeline reads, mostly one, and the layouts that describe them.

use std::sync::Arc;

use ash::vk;

use crate::attachment::Attachment;
use crate::buffer::Buffer;
use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;

/// Something a shader binds; its place in the list is its binding number.
#[derive(Debug, Clone, Copy)]
pub enum Resource<'a> {
    /// A storage buffer.
    Storage(&'a Buffer),
    /// A uniform buffer.
    Uniform(&'a Buffer),
    /// An input attachment: what an earlier subpass drew, at the same pixel.
    Input(&'a Attachment),
}

impl Resource<'_> {
    fn kind(&self) -> vk::DescriptorType {
        match self {
            Self::Storage(_) => vk::DescriptorType::STORAGE_BUFFER,
            Self::Uniform(_) => vk::DescriptorType::UNIFORM_BUFFER,
            Self::Input(_) => vk::DescriptorType::INPUT_ATTACHMENT,
        }
    }

    /// Of those stages the ones that it can be bound for: input attachments are for fragments alone.
    fn stages(&self, bound: vk::ShaderStageFlags) -> vk::ShaderStageFlags {
        match self {
            Self::Input(_) => vk::ShaderStageFlags::FRAGMENT,
            _ => bound,
        }
    }
}

/// Descriptor sets of one layout with everything they were made from.
#[derive(Debug)]
pub struct Bindings {
    gpu: Arc<Gpu>,
    stages: vk::ShaderStageFlags,
    set_layout: vk::DescriptorSetLayout,
    layout: vk::PipelineLayout,
    pool: vk::DescriptorPool,
    sets: Vec<vk::DescriptorSet>,
}

impl Bindings {
    /// As many sets, at least one, all of them of these resources.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        stages: vk::ShaderStageFlags,
        push_bytes: u32,
        sets: u32,
        resources: &[Resource<'_>],
    ) -> Result<Self, VulkanError> {
        let mut made = Self {
            gpu: Arc::clone(gpu),
            stages,
            set_layout: vk::DescriptorSetLayout::null(),
            layout: vk::PipelineLayout::null(),
            pool: vk::DescriptorPool::null(),
            sets: Vec::new(),
        };
        made.make_layout(push_bytes, resources)?;
        made.make_sets(sets, resources)?;
        made.bind(resources);
        Ok(made)
    }

    fn make_layout(
        &mut self,
        push_bytes: u32,
        resources: &[Resource<'_>],
    ) -> Result<(), VulkanError> {
        let device = self.gpu.device();
        let bindings: Vec<_> = (0..)
            .zip(resources)
            .map(|(binding, resource)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(resource.kind())
                    .descriptor_count(1)
                    .stage_flags(resource.stages(self.stages))
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: the structure is complete.
        self.set_layout = unsafe { device.create_descriptor_set_layout(&info, None) }
            .during("vkCreateDescriptorSetLayout")?;
        let layouts = [self.set_layout];
        let ranges = [vk::PushConstantRange {
            stage_flags: self.stages,
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

    fn make_sets(&mut self, sets: u32, resources: &[Resource<'_>]) -> Result<(), VulkanError> {
        let device = self.gpu.device();
        let sizes: Vec<_> = resources
            .iter()
            .map(|resource| vk::DescriptorPoolSize {
                ty: resource.kind(),
                descriptor_count: sets,
            })
            .collect();
        let info = vk::DescriptorPoolCreateInfo::default()
            .max_sets(sets)
            .pool_sizes(&sizes);
        // SAFETY: the structure is complete.
        self.pool = unsafe { device.create_descriptor_pool(&info, None) }
            .during("vkCreateDescriptorPool")?;
        let layouts = vec![self.set_layout; sets as usize];
        let info = vk::DescriptorSetAllocateInfo::default()
            .descriptor_pool(self.pool)
            .set_layouts(&layouts);
        // SAFETY: pool and layout are alive, and the pool has room for so many sets.
        self.sets =
            unsafe { device.allocate_descriptor_sets(&info) }.during("vkAllocateDescriptorSets")?;
        Ok(())
    }

    /// Binds other resources of the same kinds in all sets. The device is not using them, and the resources
    /// outlive their next use.
    pub fn bind(&mut self, resources: &[Resource<'_>]) {
        for set in 0..self.sets.len() {
            for (binding, resource) in (0..).zip(resources) {
                self.rebind(set, binding, *resource);
            }
        }
    }

    /// Binds another resource of the same kind in one place of one set, under the same conditions.
    pub fn rebind(&mut self, set: usize, binding: u32, resource: Resource<'_>) {
        let (buffers, images);
        let write = vk::WriteDescriptorSet::default()
            .dst_set(self.set(set))
            .dst_binding(binding)
            .descriptor_type(resource.kind());
        let write = match resource {
            Resource::Storage(buffer) | Resource::Uniform(buffer) => {
                buffers = [vk::DescriptorBufferInfo {
                    buffer: buffer.handle(),
                    offset: 0,
                    range: buffer.size(),
                }];
                write.buffer_info(&buffers)
            }
            Resource::Input(attachment) => {
                images = [vk::DescriptorImageInfo {
                    sampler: vk::Sampler::null(),
                    image_view: attachment.view.handle(),
                    image_layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
                }];
                write.image_info(&images)
            }
        };
        // SAFETY: the set is not in use (the caller's promise), the resource is alive.
        unsafe { self.gpu.device().update_descriptor_sets(&[write], &[]) };
    }

    /// The pipeline layout.
    pub fn layout(&self) -> vk::PipelineLayout {
        self.layout
    }

    /// One of the sets there are.
    fn set(&self, index: usize) -> vk::DescriptorSet {
        self.sets.get(index).copied().unwrap_or_default()
    }

    /// Records the use of a set, and of these push constants, by the pipelines that follow.
    pub fn record(
        &self,
        commands: vk::CommandBuffer,
        point: vk::PipelineBindPoint,
        set: usize,
        push: &[u32],
    ) {
        let device = self.gpu.device();
        // SAFETY: the command buffer is being recorded; set and push constants match the layout.
        unsafe {
            device.cmd_bind_descriptor_sets(commands, point, self.layout, 0, &[self.set(set)], &[]);
            if !push.is_empty() {
                let bytes = bytemuck::cast_slice(push);
                device.cmd_push_constants(commands, self.layout, self.stages, 0, bytes);
            }
        }
    }
}

impl Drop for Bindings {
    fn drop(&mut self) {
        let device = self.gpu.device();
        // SAFETY: owners wait for the device before they drop; destroying a null handle does nothing.
        unsafe {
            device.destroy_descriptor_pool(self.pool, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
