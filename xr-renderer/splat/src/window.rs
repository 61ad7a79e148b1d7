//! Showing the first view in a window, over a backdrop; or a picture that the host has.
//!
//! The picture, however small it was drawn, is fitted into the window on the device. No event loop: the caller owns the window.

use std::sync::Arc;

use ash::vk;
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};
use renderer_vulkan::bindings::Resource;
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::commands::{Commands, barrier};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::pipeline::{ComputePipeline, Specialisation};
use renderer_vulkan::surface::{Surface, no_presentation};
use renderer_vulkan::swapchain::{Acquired, Swapchain};

use crate::error::RenderError;
use crate::host_picture::HostPicture;
use crate::picture::Backdrop;
use crate::renderer::SplatRenderer;

const GROUP: u32 = 64;
/// Of `ComposeParams` in the shader.
const PUSH_WORDS: usize = 14;
const PUSH_BYTES: u32 = 56;

/// The result of presenting a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PresentOutcome {
    /// The window shows it.
    Presented,
    /// The window was changing, has no area (minimised) or is hidden: draw again later.
    NotNow,
}

/// A window that pictures are shown in. Keeps the window alive.
pub struct WindowTarget {
    // Dropped in this order: commands wait for the queue's own work, though not for the display, of which
    // the swapchain's drop tells more; the surface goes after its swapchain.
    commands: Commands,
    swapchain: Option<Swapchain>,
    surface: Surface,
    composed: Option<Composed>,
    wanted: vk::Extent2D,
    gpu: Arc<Gpu>,
}

/// The window's pixels before they are copied to one of its images.
struct Composed {
    pixels: Buffer,
    extent: vk::Extent2D,
    pipeline: ComputePipeline,
}

impl std::fmt::Debug for WindowTarget {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WindowTarget")
            .field("wanted", &self.wanted)
            .finish_non_exhaustive()
    }
}

impl WindowTarget {
    /// Takes a window to show pictures in; its inner size in pixels counts where the windowing system
    /// leaves the size of the images to us (Wayland).
    ///
    /// # Errors
    /// A device or driver that cannot show pictures in this window.
    pub fn new<W>(
        gpu: &Arc<Gpu>,
        window: Arc<W>,
        width: u32,
        height: u32,
    ) -> Result<Self, VulkanError>
    where
        W: HasWindowHandle + HasDisplayHandle + Send + Sync + 'static,
    {
        Self::on(gpu, Surface::of_window(gpu, window)?, width, height)
    }

    /// A surface without a window, for tests of presentation.
    ///
    /// # Errors
    /// A driver without `VK_EXT_headless_surface`.
    pub fn headless(gpu: &Arc<Gpu>, width: u32, height: u32) -> Result<Self, VulkanError> {
        Self::on(gpu, Surface::headless(gpu)?, width, height)
    }

    fn on(gpu: &Arc<Gpu>, surface: Surface, width: u32, height: u32) -> Result<Self, VulkanError> {
        // Reported now rather than at the first picture.
        let _format = surface.format()?;
        Ok(Self {
            commands: Commands::new(gpu)?,
            swapchain: None,
            surface,
            composed: None,
            wanted: vk::Extent2D { width, height },
            gpu: Arc::clone(gpu),
        })
    }

    /// Sets the window's new inner size, in pixels.
    pub fn resize(&mut self, width: u32, height: u32) {
        self.wanted = vk::Extent2D { width, height };
        if let Some(swapchain) = &mut self.swapchain {
            // Of no area: no picture fits it, so the next one makes a new swapchain.
            swapchain.extent = vk::Extent2D::default();
        }
    }

    /// Shows the renderer's first view, waiting for the display if it is busy, but not for a window that
    /// is hidden: that one is [`PresentOutcome::NotNow`] after 0.2 s.
    ///
    /// # Errors
    /// A renderer on another device, a device that fails, or a window that is gone.
    pub fn present(
        &mut self,
        renderer: &SplatRenderer,
        backdrop: Backdrop,
    ) -> Result<PresentOutcome, RenderError> {
        if !Arc::ptr_eq(renderer.gpu(), &self.gpu) {
            return Err(no_presentation(&self.gpu, "the renderer draws on another device").into());
        }
        let target = renderer.target()?;
        let pixels = &target.buffer;
        self.present_pixels(pixels, [target.width, target.height], backdrop)
    }

    /// As [`Self::present`], of a picture that the host has.
    ///
    /// # Errors
    /// A picture on another device, a device that fails, or a window that is gone.
    pub fn present_picture(
        &mut self,
        picture: &HostPicture,
        backdrop: Backdrop,
    ) -> Result<PresentOutcome, RenderError> {
        if !picture.pixels.is_on(&self.gpu) {
            return Err(no_presentation(&self.gpu, "the picture is on another device").into());
        }
        self.present_pixels(&picture.pixels, [picture.width, picture.height], backdrop)
    }

    fn present_pixels(
        &mut self,
        pixels: &Buffer,
        size: [u32; 2],
        backdrop: Backdrop,
    ) -> Result<PresentOutcome, RenderError> {
        // What follows frees and rebinds what an earlier picture may still be made with.
        self.commands.wait()?;
        if self
            .swapchain
            .as_ref()
            .is_none_or(|swapchain| swapchain.extent.width == 0)
        {
            self.renew()?;
        }
        let Some(swapchain) = &self.swapchain else {
            return Ok(PresentOutcome::NotNow);
        };
        // The picture's buffer may be another renderer's each time.
        let composed = Composed::new(&self.gpu, pixels, swapchain.extent, self.composed.take())?;
        let index = match swapchain.acquire()? {
            Acquired::Image(index) => index,
            Acquired::Busy => {
                self.composed = Some(composed);
                return Ok(PresentOutcome::NotNow);
            }
            Acquired::Outdated => {
                self.resize(self.wanted.width, self.wanted.height);
                return Ok(PresentOutcome::NotNow);
            }
        };
        let (image, written) = swapchain.image(index);
        let push = push_words(size, swapchain, backdrop);
        let gpu = &self.gpu;
        let shown = self
            .commands
            .run_between(
                "showing",
                Some(swapchain.acquired),
                Some(written),
                |commands| {
                    composed.record(gpu, commands, &push, image);
                },
            )
            .and_then(|()| swapchain.present(index));
        // Kept in any case: after an error the device may still be working on it.
        self.composed = Some(composed);
        if !matches!(shown, Ok(true)) {
            // After an error the image was never shown and its semaphores may be left signalled: the next
            // picture takes new ones.
            self.resize(self.wanted.width, self.wanted.height);
        }
        shown?;
        Ok(PresentOutcome::Presented)
    }

    /// A swapchain for the window as it is now; none while it has no area. No work is in flight.
    fn renew(&mut self) -> Result<(), VulkanError> {
        self.composed = None;
        let old = self.swapchain.take();
        self.swapchain = Swapchain::new(&self.gpu, &self.surface, self.wanted, old)?;
        Ok(())
    }
}

impl Composed {
    /// Pixels of the window's size, reusing the last ones if they are that large. The device is idle.
    fn new(
        gpu: &Arc<Gpu>,
        picture: &Buffer,
        extent: vk::Extent2D,
        last: Option<Self>,
    ) -> Result<Self, VulkanError> {
        let picture = Resource::Storage(picture);
        if let Some(mut last) = last.filter(|last| last.extent == extent) {
            last.pipeline
                .bind(&[picture, Resource::Storage(&last.pixels)]);
            return Ok(last);
        }
        let bytes = u64::from(extent.width) * u64::from(extent.height) * 4;
        let pixels = Buffer::storage(gpu, "the window's pixels", bytes)?;
        let specialisation = Specialisation {
            constants: &[GROUP],
            push_bytes: PUSH_BYTES,
            ..Default::default()
        };
        let resources = [picture, Resource::Storage(&pixels)];
        let pipeline = ComputePipeline::new(
            gpu,
            shaders_spirv::COMPOSE.words,
            specialisation,
            &resources,
        )?;
        Ok(Self {
            pixels,
            extent,
            pipeline,
        })
    }

    fn record(
        &self,
        gpu: &Gpu,
        commands: vk::CommandBuffer,
        push: &[u32; PUSH_WORDS],
        image: vk::Image,
    ) {
        let vk::Extent2D { width, height } = self.extent;
        self.pipeline
            .dispatch(commands, push, [width.div_ceil(GROUP), height, 1]);
        barrier(gpu, commands);
        let range = vk::ImageSubresourceRange {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            base_mip_level: 0,
            level_count: 1,
            base_array_layer: 0,
            layer_count: 1,
        };
        let change = vk::ImageMemoryBarrier::default()
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image)
            .subresource_range(range);
        let writable = change
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
            .dst_access_mask(vk::AccessFlags::TRANSFER_WRITE);
        let showable = change
            .old_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
            .new_layout(vk::ImageLayout::PRESENT_SRC_KHR)
            .src_access_mask(vk::AccessFlags::TRANSFER_WRITE);
        let region = [vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_extent(vk::Extent3D {
                width,
                height,
                depth: 1,
            })];
        let transfer = vk::PipelineStageFlags::TRANSFER;
        let end = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        let none = vk::DependencyFlags::empty();
        let device = gpu.device();
        // SAFETY: the command buffer is being recorded; the image is acquired (its semaphore holds back
        // transfers) and as large as the region, which the buffer fills.
        unsafe {
            device.cmd_pipeline_barrier(commands, transfer, transfer, none, &[], &[], &[writable]);
            device.cmd_copy_buffer_to_image(
                commands,
                self.pixels.handle(),
                image,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &region,
            );
            device.cmd_pipeline_barrier(commands, transfer, end, none, &[], &[], &[showable]);
        }
    }
}

/// `ComposeParams` in `shaders/compose.comp`, as words.
fn push_words(picture: [u32; 2], swapchain: &Swapchain, backdrop: Backdrop) -> [u32; PUSH_WORDS] {
    let [across, down] = picture;
    let (top, bottom) = backdrop.ends();
    let [t0, t1, t2] = top.map(f32::to_bits);
    let [b0, b1, b2] = bottom.map(f32::to_bits);
    let vk::Extent2D { width, height } = swapchain.extent;
    let blue_first = u32::from(swapchain.blue_first);
    [
        t0, t1, t2, 0, b0, b1, b2, 0, across, down, width, height, 0, blue_first,
    ]
}
