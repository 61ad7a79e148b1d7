//! A pipeline that draws triangles made by its shaders alone.

use std::sync::Arc;

use ash::vk;

use crate::error::{VkContext, VulkanError};
use crate::gpu::Gpu;

/// The settings of a pipeline; the rest is the same for all: no vertices, no culling, one sample.
#[derive(Debug)]
pub struct GraphicsPipelineInfo<'a> {
    /// The shaders.
    pub stages: &'a [vk::PipelineShaderStageCreateInfo<'a>],
    /// The blending of each colour attachment.
    pub blends: &'a [vk::PipelineColorBlendAttachmentState],
    /// Whether every pixel writes the depth that its shader gives.
    pub writes_depth: bool,
    /// Of the descriptor sets and push constants.
    pub layout: vk::PipelineLayout,
    /// The pass that the pipeline draws in.
    pub pass: vk::RenderPass,
    /// Which part of it.
    pub subpass: u32,
}

/// The pipeline. Viewport and scissor are set when it is used: see [`Self::record`].
#[derive(Debug)]
pub struct GraphicsPipeline {
    gpu: Arc<Gpu>,
    handle: vk::Pipeline,
}

impl GraphicsPipeline {
    /// Compiles it.
    ///
    /// # Errors
    /// A device that fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        description: &GraphicsPipelineInfo<'_>,
    ) -> Result<Self, VulkanError> {
        let input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
            .topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default()
            .viewport_count(1)
            .scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(vk::CullModeFlags::NONE)
            .line_width(1.0);
        let samples = vk::PipelineMultisampleStateCreateInfo::default()
            .rasterization_samples(vk::SampleCountFlags::TYPE_1);
        // Vulkan writes no depth that it does not test.
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(description.writes_depth)
            .depth_write_enable(description.writes_depth)
            .depth_compare_op(vk::CompareOp::ALWAYS);
        let blend =
            vk::PipelineColorBlendStateCreateInfo::default().attachments(description.blends);
        let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
        let info = [vk::GraphicsPipelineCreateInfo::default()
            .stages(description.stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(description.layout)
            .render_pass(description.pass)
            .subpass(description.subpass)];
        let device = gpu.device();
        // SAFETY: modules, layout, pass and all structures live until the call returns.
        let made =
            unsafe { device.create_graphics_pipelines(vk::PipelineCache::null(), &info, None) };
        let pipelines = made
            .map_err(|(_, result)| result)
            .during("vkCreateGraphicsPipelines")?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            handle: pipelines.first().copied().unwrap_or_default(),
        })
    }

    /// Records that what is drawn next is drawn by it, over this area, which begins in the upper left corner. Its pass is being
    /// recorded.
    pub fn record(&self, commands: vk::CommandBuffer, area: vk::Rect2D) {
        let viewport = vk::Viewport {
            width: pixels(area.extent.width),
            height: pixels(area.extent.height),
            max_depth: 1.0,
            ..Default::default()
        };
        let device = self.gpu.device();
        // SAFETY: the command buffer is being recorded, within the pass that the pipeline was made for.
        unsafe {
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, self.handle);
            device.cmd_set_viewport(commands, 0, &[viewport]);
            device.cmd_set_scissor(commands, 0, &[area]);
        }
    }
}

impl Drop for GraphicsPipeline {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop.
        unsafe { self.gpu.device().destroy_pipeline(self.handle, None) };
    }
}

/// Pixel counts are at most 4096: exact in f32.
#[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
fn pixels(count: u32) -> f32 {
    count as f32
}
