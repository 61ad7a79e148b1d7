//! Render passes and framebuffers.

use std::sync::Arc;

use ash::vk;

use crate::attachment::View;
use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;

/// A render pass.
#[derive(Debug)]
pub struct RenderPass {
    gpu: Arc<Gpu>,
    handle: vk::RenderPass,
}

impl RenderPass {
    /// As it is described; multiview may be used.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(gpu: &Arc<Gpu>, info: &vk::RenderPassCreateInfo<'_>) -> Result<Self, VulkanError> {
        // SAFETY: the structures live until the call returns; multiview was enabled with the device.
        let handle =
            unsafe { gpu.device().create_render_pass(info, None) }.during("vkCreateRenderPass")?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            handle,
        })
    }

    /// For pipelines and framebuffers, which it outlives.
    #[must_use]
    pub fn handle(&self) -> vk::RenderPass {
        self.handle
    }
}

impl Drop for RenderPass {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop.
        unsafe { self.gpu.device().destroy_render_pass(self.handle, None) };
    }
}

/// Images that a multiview pass draws into together.
#[derive(Debug)]
pub struct Framebuffer {
    gpu: Arc<Gpu>,
    handle: vk::Framebuffer,
}

impl Framebuffer {
    /// Of views that outlive it, one for each attachment of the pass, all at least of this size in pixels.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new<'a>(
        pass: &RenderPass,
        views: impl IntoIterator<Item = &'a View>,
        size: vk::Extent2D,
    ) -> Result<Self, VulkanError> {
        let views: Vec<_> = views.into_iter().map(View::handle).collect();
        // With multiview the view mask chooses the layers, and the framebuffer counts as one.
        let info = vk::FramebufferCreateInfo::default()
            .render_pass(pass.handle)
            .attachments(&views)
            .width(size.width)
            .height(size.height)
            .layers(1);
        let gpu = &pass.gpu;
        // SAFETY: pass and views are alive and fit one another.
        let handle = unsafe { gpu.device().create_framebuffer(&info, None) }
            .during("vkCreateFramebuffer")?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            handle,
        })
    }

    /// For the beginning of its pass.
    #[must_use]
    pub fn handle(&self) -> vk::Framebuffer {
        self.handle
    }
}

impl Drop for Framebuffer {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop.
        unsafe { self.gpu.device().destroy_framebuffer(self.handle, None) };
    }
}
