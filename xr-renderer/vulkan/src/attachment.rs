//! Colour attachments with one layer for each view, and views of images.

use std::sync::Arc;

use ash::vk;

use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;
use crate::memory::Memory;

/// What an attachment's contents are used for after they were drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AttachmentUse {
    /// They are copied to a buffer.
    Copied,
    /// Only a later subpass of the same pass reads them: a tile-based GPU never writes them to memory.
    Transient,
}

/// A view of all layers of an image, which outlives it.
#[derive(Debug)]
pub struct View {
    gpu: Arc<Gpu>,
    handle: vk::ImageView,
}

impl View {
    /// The aspect is what the format has: colour, or depth.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        image: vk::Image,
        format: vk::Format,
        layers: u32,
    ) -> Result<Self, VulkanError> {
        let info = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D_ARRAY)
            .format(format)
            .subresource_range(vk::ImageSubresourceRange {
                aspect_mask: match format {
                    vk::Format::D32_SFLOAT => vk::ImageAspectFlags::DEPTH,
                    _ => vk::ImageAspectFlags::COLOR,
                },
                base_mip_level: 0,
                level_count: 1,
                base_array_layer: 0,
                layer_count: layers,
            });
        // SAFETY: the image is the device's, has memory, and that format and so many layers.
        let handle =
            unsafe { gpu.device().create_image_view(&info, None) }.during("vkCreateImageView")?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            handle,
        })
    }

    /// For framebuffers and descriptor sets.
    pub fn handle(&self) -> vk::ImageView {
        self.handle
    }
}

impl Drop for View {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop.
        unsafe { self.gpu.device().destroy_image_view(self.handle, None) };
    }
}

/// An image with its memory.
#[derive(Debug)]
struct OwnedImage {
    gpu: Arc<Gpu>,
    handle: vk::Image,
    // Dropped after the image is destroyed.
    memory: Option<Memory>,
}

impl Drop for OwnedImage {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop.
        unsafe { self.gpu.device().destroy_image(self.handle, None) };
    }
}

/// A colour attachment with its memory and the view of all its layers.
#[derive(Debug)]
pub struct Attachment {
    // Dropped first.
    /// For framebuffers and descriptor sets.
    pub view: View,
    image: OwnedImage,
    layers: u32,
}

impl Attachment {
    /// An image of a size for so many views.
    ///
    /// # Errors
    /// Too little memory, or a device that fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        what: &'static str,
        format: vk::Format,
        size: vk::Extent2D,
        layers: u32,
        usage_after: AttachmentUse,
    ) -> Result<Self, VulkanError> {
        use vk::{ImageUsageFlags as Usage, MemoryPropertyFlags as Kind};
        let usage = match usage_after {
            AttachmentUse::Copied => Usage::TRANSFER_SRC,
            AttachmentUse::Transient => Usage::INPUT_ATTACHMENT | Usage::TRANSIENT_ATTACHMENT,
        };
        let kinds: &[_] = match usage_after {
            AttachmentUse::Copied => &[Kind::DEVICE_LOCAL, Kind::empty()],
            AttachmentUse::Transient => {
                &[Kind::LAZILY_ALLOCATED, Kind::DEVICE_LOCAL, Kind::empty()]
            }
        };
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(size.into())
            .mip_levels(1)
            .array_layers(layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(Usage::COLOR_ATTACHMENT | usage);
        let device = gpu.device();
        // SAFETY: the structure is complete.
        let handle = unsafe { device.create_image(&info, None) }.during("vkCreateImage")?;
        // Owns the handle from here on, so that an error below frees it.
        let mut image = OwnedImage {
            gpu: Arc::clone(gpu),
            handle,
            memory: None,
        };
        // SAFETY: the image is this device's.
        let needs = unsafe { device.get_image_memory_requirements(handle) };
        let memory = Memory::new(gpu, what, needs, kinds)?;
        let memory_handle = memory.handle();
        image.memory = Some(memory);
        // SAFETY: fresh memory of the size and type the image asked for.
        unsafe { device.bind_image_memory(handle, memory_handle, 0) }
            .during("vkBindImageMemory")?;
        Ok(Self {
            view: View::new(gpu, handle, format, layers)?,
            image,
            layers,
        })
    }

    /// Records the copy of the picture's part of all layers, which a render pass left ready for it, into a buffer whose rows have `stride`
    /// pixels.
    pub fn record_copy(
        &self,
        commands: vk::CommandBuffer,
        buffer: vk::Buffer,
        stride: u32,
        size: vk::Extent2D,
    ) {
        let region = [vk::BufferImageCopy::default()
            .buffer_row_length(stride)
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: self.layers,
            })
            .image_extent(size.into())];
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        let OwnedImage { gpu, handle, .. } = &self.image;
        // SAFETY: the command buffer is being recorded; the buffer holds all layers at that stride.
        unsafe {
            let device = gpu.device();
            device.cmd_copy_image_to_buffer(commands, *handle, layout, buffer, &region);
        }
    }
}
