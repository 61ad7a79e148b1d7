//! A flat panel in the room, sampled by the compositor at the display's resolution.

use std::sync::Arc;

use ash::vk;
use openxr::{Session, SwapchainUsageFlags, Vulkan};
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::commands::{Commands, barrier};
use renderer_vulkan::gpu::Gpu;

use crate::error::{XrContext, XrError};
use crate::swapchain::{Swapchain, SwapchainKind, first_common};

const COLOURS: [vk::Format; 2] = [vk::Format::R8G8B8A8_SRGB, vk::Format::R8G8B8A8_UNORM];

/// Longest side of a panel, pixels.
const LONGEST: u32 = 2048;

/// What a panel shows.
#[derive(Debug, Clone, Copy)]
pub struct PanelImage<'a> {
    /// Width in pixels, 2048 at most.
    pub width: u32,
    /// Height in pixels, 2048 at most.
    pub height: u32,
    /// Premultiplied RGBA in the sRGB curve, row by row from the top.
    pub rgba: &'a [u8],
}

/// The panel's images.
pub(crate) struct Panel {
    commands: Commands,
    pub(crate) images: Swapchain,
    upload: Buffer,
    gpu: Arc<Gpu>,
}

impl Panel {
    /// A panel that shows `image`; nothing where it has no pixels, or too many.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        session: &Session<Vulkan>,
        image: PanelImage<'_>,
    ) -> Result<Option<Self>, XrError> {
        let PanelImage { width, height, .. } = image;
        let sizes = 1..=LONGEST;
        if !sizes.contains(&width) || !sizes.contains(&height) {
            return Ok(None);
        }
        let offered = session
            .enumerate_swapchain_formats()
            .during("xrEnumerateSwapchainFormats")?;
        let Some(format) = first_common(&COLOURS, &offered) else {
            return Ok(None);
        };
        let kind = SwapchainKind {
            format,
            extent: vk::Extent2D { width, height },
            layers: 1,
            usage: SwapchainUsageFlags::COLOR_ATTACHMENT
                | SwapchainUsageFlags::SAMPLED
                | SwapchainUsageFlags::TRANSFER_DST,
        };
        let bytes = u64::from(width) * u64::from(height) * 4;
        let usage = vk::BufferUsageFlags::empty();
        let mut panel = Self {
            commands: Commands::new(gpu)?,
            images: Swapchain::new(gpu, session, kind)?,
            upload: Buffer::new(gpu, "the panel", bytes, usage, MemoryUsage::Upload)?,
            gpu: Arc::clone(gpu),
        };
        panel.show(image)?;
        Ok(Some(panel))
    }

    /// Whether it has this image's size.
    pub(crate) fn fits(&self, image: PanelImage<'_>) -> bool {
        let vk::Extent2D { width, height } = self.images.extent;
        (width, height) == (image.width, image.height)
    }

    /// Shows another image of its size.
    pub(crate) fn show(&mut self, image: PanelImage<'_>) -> Result<(), XrError> {
        let vk::Extent2D { width, height } = self.images.extent;
        let bytes = width as usize * height as usize * 4;
        let Some(rgba) = image.rgba.get(..bytes).filter(|_| self.fits(image)) else {
            return Ok(());
        };
        self.commands.wait()?;
        self.upload.write(rgba);
        let image = self.images.acquire()?.image;
        let range = vk::ImageSubresourceRange {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            level_count: 1,
            layer_count: 1,
            ..Default::default()
        };
        let change = vk::ImageMemoryBarrier::default()
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image)
            .subresource_range(range);
        let writable = [change
            .new_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
            .dst_access_mask(vk::AccessFlags::TRANSFER_WRITE)];
        let showable = [change
            .old_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
            .new_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
            .dst_access_mask(vk::AccessFlags::MEMORY_READ)];
        let region = [vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                layer_count: 1,
                ..Default::default()
            })
            .image_extent(vk::Extent3D {
                width,
                height,
                depth: 1,
            })];
        let (gpu, from) = (&self.gpu, self.upload.handle());
        let submitted = self.commands.submit("showing the panel", |commands| {
            use vk::PipelineStageFlags as Stage;
            let (none, device) = (vk::DependencyFlags::empty(), gpu.device());
            barrier(gpu, commands);
            // SAFETY: the command buffer is being recorded; the image was acquired and its compositor waited for; the buffer
            // holds as many bytes as the region, which is all of the image.
            unsafe {
                device.cmd_pipeline_barrier(
                    commands,
                    Stage::ALL_COMMANDS,
                    Stage::TRANSFER,
                    none,
                    &[],
                    &[],
                    &writable,
                );
                device.cmd_copy_buffer_to_image(
                    commands,
                    from,
                    image,
                    vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                    &region,
                );
                device.cmd_pipeline_barrier(
                    commands,
                    Stage::TRANSFER,
                    Stage::ALL_COMMANDS,
                    none,
                    &[],
                    &[],
                    &showable,
                );
            }
        });
        self.images.release()?;
        Ok(submitted?)
    }
}
