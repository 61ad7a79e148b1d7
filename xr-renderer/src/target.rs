//! The picture on the device: one layer per view, premultiplied RGBA in half floats.

use std::sync::Arc;

use ash::vk;

use crate::buffer::allocate;
use crate::error::{RenderError, VkContext};
use crate::gpu::Gpu;

/// What the raster shader writes: display values, so no transfer function on the way.
pub(crate) const FORMAT: vk::Format = vk::Format::R16G16B16A16_SFLOAT;

/// An image array that compute shaders write and copies read. It stays in `GENERAL` layout.
pub(crate) struct Target {
    gpu: Arc<Gpu>,
    image: vk::Image,
    memory: vk::DeviceMemory,
    view: vk::ImageView,
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
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(FORMAT)
            .extent(vk::Extent3D { width, height, depth: 1 })
            .mip_levels(1)
            .array_layers(layers)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(
                vk::ImageUsageFlags::STORAGE
                    | vk::ImageUsageFlags::TRANSFER_SRC
                    | vk::ImageUsageFlags::SAMPLED,
            );
        // SAFETY: the structure is complete; the format's storage support is mandatory in Vulkan.
        let image = unsafe { gpu.device().create_image(&info, None) }.during("vkCreateImage")?;
        let mut target = Self {
            gpu: Arc::clone(gpu),
            image,
            memory: vk::DeviceMemory::null(),
            view: vk::ImageView::null(),
            width,
            height,
            layers,
        };
        // SAFETY: the handle is an image of this device.
        let needs = unsafe { gpu.device().get_image_memory_requirements(image) };
        let kinds = [vk::MemoryPropertyFlags::DEVICE_LOCAL, vk::MemoryPropertyFlags::empty()];
        target.memory = allocate(gpu, "the picture", needs, &kinds)?;
        // SAFETY: fresh memory of the size and type the image asked for.
        unsafe { gpu.device().bind_image_memory(image, target.memory, 0) }
            .during("vkBindImageMemory")?;
        let info = vk::ImageViewCreateInfo::default()
            .image(image)
            .view_type(vk::ImageViewType::TYPE_2D_ARRAY)
            .format(FORMAT)
            .subresource_range(target.all());
        // SAFETY: the image is bound and the range lies in it.
        target.view =
            unsafe { gpu.device().create_image_view(&info, None) }.during("vkCreateImageView")?;
        Ok(target)
    }

    pub(crate) fn image(&self) -> vk::Image {
        self.image
    }

    pub(crate) fn view(&self) -> vk::ImageView {
        self.view
    }

    /// All layers.
    pub(crate) fn all(&self) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            base_mip_level: 0,
            level_count: 1,
            base_array_layer: 0,
            layer_count: self.layers,
        }
    }

    /// One layer.
    pub(crate) fn layer(&self, layer: u32) -> vk::ImageSubresourceLayers {
        vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: layer,
            layer_count: 1,
        }
    }

    pub(crate) fn extent(&self) -> vk::Extent3D {
        vk::Extent3D { width: self.width, height: self.height, depth: 1 }
    }
}

impl Drop for Target {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop.
        unsafe {
            self.gpu.device().destroy_image_view(self.view, None);
            self.gpu.device().destroy_image(self.image, None);
            self.gpu.device().free_memory(self.memory, None);
        }
    }
}
