//! An image that quads are drawn into: one layer per view.

use std::sync::Arc;

use ash::vk;

use crate::error::{RenderError, VkContext};
use crate::gpu::Gpu;
use crate::memory::Memory;
use crate::target::Target;

/// A colour attachment with its memory and the view of all its layers.
pub(crate) struct Attachment {
    gpu: Arc<Gpu>,
    pub(crate) image: vk::Image,
    pub(crate) view: vk::ImageView,
    // Dropped after the image is destroyed.
    memory: Option<Memory>,
}

impl Attachment {
    /// An image of the largest size that the target has room for, and with its layers.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        what: &'static str,
        format: vk::Format,
        target: &Target,
    ) -> Result<Self, RenderError> {
        let device = gpu.device();
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(target.most.into())
            .mip_levels(1)
            .array_layers(target.layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC);
        // Owns each handle from here on, so that an error below frees them.
        let mut made = Self {
            gpu: Arc::clone(gpu),
            image: vk::Image::null(),
            view: vk::ImageView::null(),
            memory: None,
        };
        // SAFETY: the structure is complete.
        made.image = unsafe { device.create_image(&info, None) }.during("vkCreateImage")?;
        // SAFETY: the image is this device's.
        let needs = unsafe { device.get_image_memory_requirements(made.image) };
        let kinds = [
            vk::MemoryPropertyFlags::DEVICE_LOCAL,
            vk::MemoryPropertyFlags::empty(),
        ];
        let memory = Memory::new(gpu, what, needs, &kinds)?;
        let memory_handle = memory.handle();
        made.memory = Some(memory);
        // SAFETY: fresh memory of the size and type the image asked for.
        unsafe { device.bind_image_memory(made.image, memory_handle, 0) }
            .during("vkBindImageMemory")?;
        let info = vk::ImageViewCreateInfo::default()
            .image(made.image)
            .view_type(vk::ImageViewType::TYPE_2D_ARRAY)
            .format(format)
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                base_mip_level: 0,
                level_count: 1,
                base_array_layer: 0,
                layer_count: target.layers,
            });
        // SAFETY: the image has memory.
        made.view = unsafe { device.create_image_view(&info, None) }.during("vkCreateImageView")?;
        Ok(made)
    }

    /// Records the copy of the picture's part of all layers, which a render pass left ready for it, into a buffer whose rows have `stride`
    /// pixels.
    pub(crate) fn record_copy(
        &self,
        commands: vk::CommandBuffer,
        buffer: vk::Buffer,
        stride: u32,
        target: &Target,
    ) {
        let region = [vk::BufferImageCopy::default()
            .buffer_row_length(stride)
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: target.layers,
            })
            .image_extent(vk::Extent3D {
                width: target.width,
                height: target.height,
                depth: 1,
            })];
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        // SAFETY: the command buffer is being recorded; the buffer holds all layers at that stride.
        unsafe {
            let device = self.gpu.device();
            device.cmd_copy_image_to_buffer(commands, self.image, layout, buffer, &region);
        }
    }
}

impl Drop for Attachment {
    fn drop(&mut self) {
        let device = self.gpu.device();
        // SAFETY: owners wait for the device before they drop; destroying a null handle does nothing.
        unsafe {
            device.destroy_image_view(self.view, None);
            device.destroy_image(self.image, None);
        }
    }
}
