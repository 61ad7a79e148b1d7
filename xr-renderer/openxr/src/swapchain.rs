//! A headset's images: arrays of one layer for each eye, handed out by the runtime one at a time.

use std::sync::Arc;

use ash::vk::{self, Handle};
use openxr::{Session, SwapchainCreateFlags, SwapchainCreateInfo, SwapchainUsageFlags, Vulkan};
use renderer_vulkan::gpu::Gpu;

use crate::error::{XrContext, XrError};
use crate::ext::foveation::{self, DensityMap, Foveation};

/// Images of one kind.
pub(crate) struct Swapchain {
    gpu: Arc<Gpu>,
    pub(crate) handle: openxr::Swapchain<Vulkan>,
    images: Vec<vk::Image>,
    /// Where each image may be drawn coarser; none where all of it is drawn finely.
    pub(crate) maps: Vec<DensityMap>,
    pub(crate) format: vk::Format,
    pub(crate) extent: vk::Extent2D,
    /// Whether an image was acquired and not released.
    held: bool,
}

/// An acquired image, until it is released.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Acquired {
    pub(crate) index: usize,
    pub(crate) image: vk::Image,
}

/// What images are made of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SwapchainKind {
    pub(crate) format: vk::Format,
    pub(crate) extent: vk::Extent2D,
    pub(crate) layers: u32,
    pub(crate) usage: SwapchainUsageFlags,
}

impl Swapchain {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        session: &Session<Vulkan>,
        kind: SwapchainKind,
    ) -> Result<Self, XrError> {
        Self::foveated(gpu, session, kind, None)
    }

    /// Images that are drawn coarser where the eye sees little, if the runtime lets us.
    pub(crate) fn foveated(
        gpu: &Arc<Gpu>,
        session: &Session<Vulkan>,
        kind: SwapchainKind,
        foveation: Option<&Foveation>,
    ) -> Result<Self, XrError> {
        let info = SwapchainCreateInfo {
            create_flags: SwapchainCreateFlags::EMPTY,
            usage_flags: kind.usage,
            format: u32::try_from(kind.format.as_raw()).unwrap_or_default(),
            sample_count: 1,
            width: kind.extent.width,
            height: kind.extent.height,
            face_count: 1,
            array_size: kind.layers,
            mip_count: 1,
        };
        let (handle, maps) = foveation::swapchain(session, foveation, &info)?;
        let images = handle
            .enumerate_images()
            .during("xrEnumerateSwapchainImages")?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            handle,
            images: images.into_iter().map(vk::Image::from_raw).collect(),
            maps,
            format: kind.format,
            extent: kind.extent,
            held: false,
        })
    }

    /// Takes the next image and waits until the compositor has read it.
    pub(crate) fn acquire(&mut self) -> Result<Acquired, XrError> {
        if self.held {
            // An error came in between.
            self.release()?;
        }
        // The runtime may use the queue in these calls.
        let index = self
            .gpu
            .with_queue(|_| self.handle.acquire_image())
            .during("xrAcquireSwapchainImage")?;
        self.handle
            .wait_image(openxr::Duration::INFINITE)
            .during("xrWaitSwapchainImage")?;
        self.held = true;
        let index = index as usize;
        let image = self.images.get(index).copied().ok_or(XrError::Call {
            call: "xrAcquireSwapchainImage",
            result: openxr::sys::Result::ERROR_VALIDATION_FAILURE,
        })?;
        Ok(Acquired { index, image })
    }

    /// The acquired image, if there is one.
    pub(crate) fn release_if_held(&mut self) -> Result<(), XrError> {
        if self.held { self.release() } else { Ok(()) }
    }

    /// All images there are.
    pub(crate) fn images(&self) -> &[vk::Image] {
        &self.images
    }

    /// Gives the image to the compositor. The work that writes it has been submitted.
    pub(crate) fn release(&mut self) -> Result<(), XrError> {
        self.held = false;
        self.gpu
            .with_queue(|_| self.handle.release_image())
            .during("xrReleaseSwapchainImage")
    }
}

/// The first of the formats that the runtime has, too.
pub(crate) fn first_common(wanted: &[vk::Format], offered: &[u32]) -> Option<vk::Format> {
    wanted
        .iter()
        .copied()
        .find(|format| u32::try_from(format.as_raw()).is_ok_and(|raw| offered.contains(&raw)))
}
