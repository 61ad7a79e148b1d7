//! Composes the picture in the renderer's target for the compositor, by compute, into buffers that are copied to its images: the tile
//! back end writes buffers, and some runtimes' images can only be copied to.

use std::sync::Arc;

use ash::vk;
use renderer_splat::target::Target;
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::commands::barrier;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};

const GROUP: u32 = 64;

/// A copied picture's buffers, and the pipeline that fills them.
pub(crate) struct Copies {
    gpu: Arc<Gpu>,
    pipeline: ComputePipeline,
    /// The renderer's buffers that the pipeline reads.
    bound: [vk::Buffer; 2],
    pixels: Buffer,
    depths: Buffer,
}

impl Copies {
    /// Room for pictures of `extent` for each eye, with depth or without.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        extent: vk::Extent2D,
        with_depth: bool,
        params: &Buffer,
        target: &Target,
    ) -> Result<Self, VulkanError> {
        let bytes = u64::from(extent.width) * u64::from(extent.height) * 4 * 2;
        let depth_bytes = if with_depth { bytes } else { 0 };
        let pixels = Buffer::storage(gpu, "the eyes' pixels", bytes)?;
        let depths = Buffer::storage(gpu, "the eyes' depths", depth_bytes)?;
        let specialisation = Specialisation {
            constants: &[GROUP],
            ..Default::default()
        };
        let resources = resources(params, target, &pixels, &depths);
        let pipeline = ComputePipeline::new(
            gpu,
            shaders_spirv::COMPOSE_EYE.words,
            specialisation,
            &resources,
        )?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            pipeline,
            bound: buffers(target),
            pixels,
            depths,
        })
    }

    /// Sets the target that is read from now on. The device is idle.
    pub(crate) fn bind(&mut self, params: &Buffer, target: &Target) {
        let buffers = buffers(target);
        if self.bound != buffers {
            self.pipeline
                .bind(&resources(params, target, &self.pixels, &self.depths));
            self.bound = buffers;
        }
    }

    /// Records the composition of the target's picture, which compute or copies wrote, and its copy to both layers of an image and of a
    /// depth image.
    pub(crate) fn record(
        &self,
        commands: vk::CommandBuffer,
        size: vk::Extent2D,
        image: vk::Image,
        depth: Option<vk::Image>,
    ) {
        let groups = [size.width.div_ceil(GROUP), size.height, 2];
        self.pipeline.dispatch(commands, &[], groups);
        barrier(&self.gpu, commands);
        let colour = ImageLayers {
            image,
            aspect: vk::ImageAspectFlags::COLOR,
            rest: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
            size,
        };
        colour.record_fill(&self.gpu, commands, &self.pixels);
        if let Some(image) = depth {
            let depth = ImageLayers {
                image,
                aspect: vk::ImageAspectFlags::DEPTH,
                rest: vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
                size,
            };
            depth.record_fill(&self.gpu, commands, &self.depths);
        }
    }
}

fn buffers(target: &Target) -> [vk::Buffer; 2] {
    [target.buffer.handle(), target.depth.handle()]
}

/// As `compose_eye.comp` binds them.
fn resources<'a>(
    params: &'a Buffer,
    target: &'a Target,
    pixels: &'a Buffer,
    depths: &'a Buffer,
) -> [Resource<'a>; 5] {
    [
        Resource::Uniform(params),
        Resource::Storage(&target.buffer),
        Resource::Storage(&target.depth),
        Resource::Storage(pixels),
        Resource::Storage(depths),
    ]
}

/// The upper left of both layers of a compositor's image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ImageLayers {
    pub(crate) image: vk::Image,
    pub(crate) aspect: vk::ImageAspectFlags,
    /// What the compositor expects the image to be left in.
    pub(crate) rest: vk::ImageLayout,
    pub(crate) size: vk::Extent2D,
}

/// How an image is used at one time: its layout, by what, and whose writes are seen.
type Use = (vk::ImageLayout, vk::PipelineStageFlags, vk::AccessFlags);

impl ImageLayers {
    /// Records that a buffer is copied to them. The image was acquired, and its compositor waited for.
    fn record_fill(&self, gpu: &Gpu, commands: vk::CommandBuffer, from: &Buffer) {
        use vk::{AccessFlags as Access, ImageLayout as Layout, PipelineStageFlags as Stage};
        let before = (Layout::UNDEFINED, Stage::ALL_COMMANDS, Access::empty());
        let writable = (
            Layout::TRANSFER_DST_OPTIMAL,
            Stage::TRANSFER,
            Access::TRANSFER_WRITE,
        );
        self.change(gpu, commands, before, writable);
        // SAFETY: the command buffer is being recorded; the buffer holds as many bytes as the regions, which lie within the
        // image.
        unsafe {
            let layout = Layout::TRANSFER_DST_OPTIMAL;
            let (device, from) = (gpu.device(), from.handle());
            device.cmd_copy_buffer_to_image(commands, from, self.image, layout, &self.regions());
        }
        let rest = (self.rest, Stage::ALL_COMMANDS, Access::MEMORY_READ);
        self.change(gpu, commands, writable, rest);
    }

    /// Records that they are copied to a buffer with room for them, and left as they were: finished.
    pub(crate) fn record_read(&self, gpu: &Gpu, commands: vk::CommandBuffer, to: &Buffer) {
        use vk::{AccessFlags as Access, ImageLayout as Layout, PipelineStageFlags as Stage};
        let rest = (self.rest, Stage::ALL_COMMANDS, Access::MEMORY_WRITE);
        let readable = (
            Layout::TRANSFER_SRC_OPTIMAL,
            Stage::TRANSFER,
            Access::TRANSFER_READ,
        );
        self.change(gpu, commands, rest, readable);
        // SAFETY: the command buffer is being recorded; the buffer has room for the regions, which lie within the image.
        unsafe {
            let layout = Layout::TRANSFER_SRC_OPTIMAL;
            let (device, to) = (gpu.device(), to.handle());
            device.cmd_copy_image_to_buffer(commands, self.image, layout, to, &self.regions());
        }
        let rest = (self.rest, Stage::ALL_COMMANDS, Access::MEMORY_READ);
        self.change(gpu, commands, readable, rest);
        barrier(gpu, commands);
    }

    /// Row by row, without gaps, one layer after the other.
    fn regions(&self) -> [vk::BufferImageCopy; 2] {
        let vk::Extent2D { width, height } = self.size;
        let layer_bytes = u64::from(width) * u64::from(height) * 4;
        [0, 1].map(|layer| {
            vk::BufferImageCopy::default()
                .buffer_offset(layer_bytes * u64::from(layer))
                .image_subresource(vk::ImageSubresourceLayers {
                    aspect_mask: self.aspect,
                    mip_level: 0,
                    base_array_layer: layer,
                    layer_count: 1,
                })
                .image_extent(self.size.into())
        })
    }

    fn change(&self, gpu: &Gpu, commands: vk::CommandBuffer, from: Use, to: Use) {
        let barriers = [vk::ImageMemoryBarrier::default()
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(self.image)
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: self.aspect,
                level_count: 1,
                layer_count: 2,
                ..Default::default()
            })
            .old_layout(from.0)
            .new_layout(to.0)
            .src_access_mask(from.2)
            .dst_access_mask(to.2)];
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is being recorded; the image is ours until it is released.
        unsafe {
            gpu.device()
                .cmd_pipeline_barrier(commands, from.1, to.1, none, &[], &[], &barriers);
        }
    }
}
