//! What quads are drawn in: one attachment, or two where depth is wanted, cleared, blended into, and left ready to be copied.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::attachment::{Attachment, AttachmentUse};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::render_pass::{Framebuffer, RenderPass};

use crate::target::Target;

/// What quads are blended in: 8 bits would not do.
pub const PICTURE: vk::Format = vk::Format::R16G16B16A16_SFLOAT;
/// As depth is, if it is drawn.
pub const DEPTH: vk::Format = vk::Format::R16_SFLOAT;

/// A multiview render pass whose first part quads can be drawn in: they write [`PICTURE`], and [`DEPTH`] if wanted.
#[derive(Debug)]
pub struct QuadPass {
    pass: RenderPass,
    with_depth: bool,
}

impl QuadPass {
    /// As it is described.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        info: &vk::RenderPassCreateInfo<'_>,
        with_depth: bool,
    ) -> Result<Self, VulkanError> {
        Ok(Self {
            pass: RenderPass::new(gpu, info)?,
            with_depth,
        })
    }

    /// The pass itself.
    #[must_use]
    pub fn render_pass(&self) -> &RenderPass {
        &self.pass
    }

    /// Whether quads write depth in it.
    #[must_use]
    pub fn with_depth(&self) -> bool {
        self.with_depth
    }
}

/// The pass of the renderer's own target, its attachments and their framebuffer.
pub(crate) struct TargetPass {
    gpu: Arc<Gpu>,
    pub(crate) pass: Arc<QuadPass>,
    // Dropped before its images.
    framebuffer: Framebuffer,
    picture: Attachment,
    depth: Option<Attachment>,
}

impl TargetPass {
    pub(crate) fn new(gpu: &Arc<Gpu>, target: &Target) -> Result<Self, VulkanError> {
        let attachment = |what: &'static str, format| {
            Attachment::new(
                gpu,
                what,
                format,
                target.most,
                target.layers,
                AttachmentUse::Copied,
            )
        };
        let picture = attachment("the quads' picture", PICTURE)?;
        let depth = target
            .has_depth()
            .then(|| attachment("the quads' depth", DEPTH))
            .transpose()?;
        let pass = make_pass(gpu, target)?;
        let attachments = std::iter::once(&picture).chain(&depth);
        let views = attachments.map(|attachment| &attachment.view);
        let framebuffer = Framebuffer::new(pass.render_pass(), views, target.most)?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            pass: Arc::new(pass),
            framebuffer,
            picture,
            depth,
        })
    }

    /// Records the pass over the picture's area with what `draw` records inside, then the copies to the target.
    pub(crate) fn record(
        &self,
        commands: vk::CommandBuffer,
        target: &Target,
        draw: impl FnOnce(vk::Rect2D),
    ) {
        let device = self.gpu.device();
        let clear = [vk::ClearValue::default(); 2];
        let area = vk::Rect2D {
            offset: vk::Offset2D::default(),
            extent: vk::Extent2D {
                width: target.width,
                height: target.height,
            },
        };
        let begin = vk::RenderPassBeginInfo::default()
            .render_pass(self.pass.render_pass().handle())
            .framebuffer(self.framebuffer.handle())
            .render_area(area)
            .clear_values(&clear);
        // SAFETY: the command buffer is being recorded; pass and framebuffer fit.
        unsafe {
            device.cmd_begin_render_pass(commands, &begin, vk::SubpassContents::INLINE);
        }
        draw(area);
        // SAFETY: as above.
        unsafe { device.cmd_end_render_pass(commands) };
        let colours = target.buffer.handle();
        self.picture
            .record_copy(commands, colours, target.width, area.extent);
        if let Some(depth) = &self.depth {
            let depths = target.depth.handle();
            depth.record_copy(commands, depths, target.depth_stride(), area.extent);
        }
    }
}

fn make_pass(gpu: &Arc<Gpu>, target: &Target) -> Result<QuadPass, VulkanError> {
    let formats = [PICTURE, DEPTH];
    let count = if target.has_depth() { 2 } else { 1 };
    let attachments = formats.map(|format| {
        vk::AttachmentDescription::default()
            .format(format)
            .samples(vk::SampleCountFlags::TYPE_1)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)
            .initial_layout(vk::ImageLayout::UNDEFINED)
            .final_layout(vk::ImageLayout::TRANSFER_SRC_OPTIMAL)
    });
    let references = [0, 1].map(|attachment| {
        vk::AttachmentReference::default()
            .attachment(attachment)
            .layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
    });
    let subpasses = [vk::SubpassDescription::default()
        .pipeline_bind_point(vk::PipelineBindPoint::GRAPHICS)
        .color_attachments(&references[..count])];
    use vk::{AccessFlags as Access, PipelineStageFlags as Stage};
    let dependencies = [
        // The sort's and the projection's results, and the last picture's copies.
        vk::SubpassDependency::default()
            .src_subpass(vk::SUBPASS_EXTERNAL)
            .dst_subpass(0)
            .src_stage_mask(Stage::COMPUTE_SHADER | Stage::TRANSFER)
            .src_access_mask(Access::SHADER_WRITE | Access::TRANSFER_READ)
            .dst_stage_mask(
                Stage::DRAW_INDIRECT | Stage::VERTEX_SHADER | Stage::COLOR_ATTACHMENT_OUTPUT,
            )
            .dst_access_mask(
                Access::INDIRECT_COMMAND_READ
                    | Access::SHADER_READ
                    | Access::UNIFORM_READ
                    | Access::COLOR_ATTACHMENT_READ
                    | Access::COLOR_ATTACHMENT_WRITE,
            ),
        vk::SubpassDependency::default()
            .src_subpass(0)
            .dst_subpass(vk::SUBPASS_EXTERNAL)
            .src_stage_mask(Stage::COLOR_ATTACHMENT_OUTPUT)
            .src_access_mask(Access::COLOR_ATTACHMENT_WRITE)
            .dst_stage_mask(Stage::TRANSFER)
            .dst_access_mask(Access::TRANSFER_READ),
    ];
    let view_masks = [(1 << target.layers) - 1];
    let mut multiview = vk::RenderPassMultiviewCreateInfo::default()
        .view_masks(&view_masks)
        .correlation_masks(&view_masks);
    let info = vk::RenderPassCreateInfo::default()
        .attachments(&attachments[..count])
        .subpasses(&subpasses)
        .dependencies(&dependencies)
        .push_next(&mut multiview);
    QuadPass::new(gpu, &info, target.has_depth())
}
