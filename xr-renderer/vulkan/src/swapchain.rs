//! The images a window shows in turn.

use std::sync::Arc;

use ash::{khr, vk};

use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;
use crate::surface::{Surface, no_presentation};

/// Many frames of any display, yet short enough that a window can be closed while it is hidden: some
/// drivers hand out no image until it is seen again.
const ACQUIRE_NANOSECONDS: u64 = 200_000_000;

/// The result of acquiring an image.
#[derive(Debug)]
pub enum Acquired {
    /// The image of this number is to be written once [`Swapchain::acquired`] is signalled.
    Image(u32),
    /// No image became free in time; the semaphore was not used.
    Busy,
    /// The window has changed: the swapchain must be made anew.
    Outdated,
}

/// One generation of a window's images: made anew when the window changes.
pub struct Swapchain {
    gpu: Arc<Gpu>,
    loader: khr::swapchain::Device,
    handle: vk::SwapchainKHR,
    /// Size of the images, pixels.
    pub extent: vk::Extent2D,
    /// Whether the channels are blue, green, red rather than red, green, blue.
    pub blue_first: bool,
    images: Vec<vk::Image>,
    /// Signalled when an image may be written. The host waits for each frame, so one is enough.
    pub acquired: vk::Semaphore,
    /// Signalled when an image is written: one each, since the display may still wait on it.
    written: Vec<vk::Semaphore>,
}

impl std::fmt::Debug for Swapchain {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Swapchain")
            .field("extent", &self.extent)
            .finish_non_exhaustive()
    }
}

impl Swapchain {
    /// Images of the window's size, or of `wanted` where the window leaves the size to us; nothing while
    /// the window has no area. The queue is idle; `old` is replaced.
    ///
    /// # Errors
    /// A window whose images cannot be copied to, or a device that fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        surface: &Surface,
        wanted: vk::Extent2D,
        old: Option<Self>,
    ) -> Result<Option<Self>, VulkanError> {
        let can = surface.capabilities()?;
        let extent = match can.current_extent {
            vk::Extent2D {
                width: u32::MAX, ..
            } => vk::Extent2D {
                width: wanted
                    .width
                    .clamp(can.min_image_extent.width, can.max_image_extent.width),
                height: wanted
                    .height
                    .clamp(can.min_image_extent.height, can.max_image_extent.height),
            },
            fixed => fixed,
        };
        if extent.width == 0 || extent.height == 0 {
            return Ok(None);
        }
        if !can
            .supported_usage_flags
            .contains(vk::ImageUsageFlags::TRANSFER_DST)
        {
            return Err(no_presentation(gpu, "its images cannot be copied to"));
        }
        let format = surface.format()?;
        let most = if can.max_image_count == 0 {
            u32::MAX
        } else {
            can.max_image_count
        };
        let alpha = [
            vk::CompositeAlphaFlagsKHR::OPAQUE,
            vk::CompositeAlphaFlagsKHR::INHERIT,
        ]
        .into_iter()
        .find(|mode| can.supported_composite_alpha.contains(*mode))
        .ok_or_else(|| no_presentation(gpu, "it offers no opaque composition"))?;
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface.handle)
            .min_image_count((can.min_image_count + 1).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::TRANSFER_DST)
            .pre_transform(can.current_transform)
            .composite_alpha(alpha)
            // Waits for the display, and every driver has it.
            .present_mode(vk::PresentModeKHR::FIFO)
            .clipped(true)
            .old_swapchain(
                old.as_ref()
                    .map_or(vk::SwapchainKHR::null(), |old| old.handle),
            );
        let loader = khr::swapchain::Device::new(&gpu.instance.handle, gpu.device());
        // SAFETY: surface and old swapchain are alive, the queue is idle.
        let handle =
            unsafe { loader.create_swapchain(&info, None) }.during("vkCreateSwapchainKHR")?;
        let mut made = Self {
            gpu: Arc::clone(gpu),
            loader,
            handle,
            extent,
            blue_first: format.format == vk::Format::B8G8R8A8_UNORM,
            images: Vec::new(),
            acquired: vk::Semaphore::null(),
            written: Vec::new(),
        };
        // SAFETY: the swapchain is alive.
        made.images = unsafe { made.loader.get_swapchain_images(handle) }
            .during("vkGetSwapchainImagesKHR")?;
        made.acquired = semaphore(gpu)?;
        for _ in 0..made.images.len() {
            made.written.push(semaphore(gpu)?);
        }
        Ok(Some(made))
    }

    /// The next image to write, waiting a moment if the display holds them all.
    ///
    /// # Errors
    /// A window that is gone, or a device that fails.
    pub fn acquire(&self) -> Result<Acquired, VulkanError> {
        // SAFETY: the semaphore is unsignalled: every earlier frame has waited for it.
        let acquired = unsafe {
            self.loader.acquire_next_image(
                self.handle,
                ACQUIRE_NANOSECONDS,
                self.acquired,
                vk::Fence::null(),
            )
        };
        match acquired {
            // Suboptimal images are still shown; `present` says that a new swapchain is due.
            Ok((index, _suboptimal)) => Ok(Acquired::Image(index)),
            Err(vk::Result::TIMEOUT | vk::Result::NOT_READY) => Ok(Acquired::Busy),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(Acquired::Outdated),
            Err(result) => Err(result).during("vkAcquireNextImageKHR"),
        }
    }

    /// An image and the semaphore that its writer signals. The index came from [`Self::acquire`].
    ///
    /// # Panics
    /// On an index beyond the images.
    pub fn image(&self, index: u32) -> (vk::Image, vk::Semaphore) {
        (self.images[index as usize], self.written[index as usize])
    }

    /// Hands a written image to the window; false if the window has changed since.
    ///
    /// # Errors
    /// As [`Self::acquire`].
    pub fn present(&self, index: u32) -> Result<bool, VulkanError> {
        let (_, written) = self.image(index);
        let (waits, swapchains, indices) = ([written], [self.handle], [index]);
        let info = vk::PresentInfoKHR::default()
            .wait_semaphores(&waits)
            .swapchains(&swapchains)
            .image_indices(&indices);
        let shown = self.gpu.with_queue(|queue| {
            // SAFETY: the image was acquired and its writer submitted; the queue is locked.
            unsafe { self.loader.queue_present(queue, &info) }
        });
        match shown {
            Ok(suboptimal) => Ok(!suboptimal),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(false),
            Err(result) => Err(result).during("vkQueuePresentKHR"),
        }
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        let device = self.gpu.device();
        // SAFETY: our own work is done after the wait, and with it every use of `acquired`. The display's
        // wait on a `written` is not: Vulkan without VK_EXT_swapchain_maintenance1 offers nothing that waits
        // for it. Its semaphore was signalled before the image was handed over, so that the wait is over as
        // soon as it begins; that it has begun by now is what programs without that extension rely on.
        unsafe {
            if let Err(result) = self.gpu.with_queue(|queue| device.queue_wait_idle(queue)) {
                log::warn!("waiting for the Vulkan queue failed: {result}");
            }
            for semaphore in self.written.drain(..) {
                device.destroy_semaphore(semaphore, None);
            }
            device.destroy_semaphore(self.acquired, None);
            self.loader.destroy_swapchain(self.handle, None);
        }
    }
}

fn semaphore(gpu: &Gpu) -> Result<vk::Semaphore, VulkanError> {
    let info = vk::SemaphoreCreateInfo::default();
    // SAFETY: no preconditions.
    unsafe { gpu.device().create_semaphore(&info, None) }.during("vkCreateSemaphore")
}
