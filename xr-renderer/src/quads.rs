//! The quad back end: one tight oriented quad for each splat, farthest first, blended by fixed function.
//!
//! Nothing is listed and nothing stored per tile, which suits GPUs that keep a tile of the picture on the chip; every
//! fragment of every splat is paid for, though, hidden or not.

use std::mem::offset_of;
use std::sync::Arc;

use ash::vk;
use shaders_spirv::{QUADS_PER_INSTANCE, SortState};

use crate::bindings::{Bindings, Resource};
use crate::buffer::{Buffer, Place};
use crate::error::{RenderError, VkContext};
use crate::front::Front;
use crate::gpu::Gpu;
use crate::pipeline::{Constants, Module};
use crate::render_pass::RenderPass;
use crate::target::Target;

/// Pipeline, pass and what they read.
pub(crate) struct Quads {
    gpu: Arc<Gpu>,
    bindings: Bindings,
    pipeline: vk::Pipeline,
    indices: Buffer,
    state: vk::Buffer,
    pass: RenderPass,
}

impl Quads {
    pub(crate) fn new(gpu: &Arc<Gpu>, front: &Front, target: &Target) -> Result<Self, RenderError> {
        let pass = RenderPass::new(gpu, target)?;
        let passed = front.passed();
        let [left, right] = &passed.splats;
        let storage = [left, right, &passed.rects, front.order(), &passed.state];
        let resources: Vec<_> = std::iter::once(Resource::Uniform(&passed.frame))
            .chain(storage.map(Resource::Storage))
            .collect();
        let bindings = Bindings::new(gpu, vk::ShaderStageFlags::VERTEX, 0, 1, &resources)?;
        let indices = index_buffer(gpu)?;
        let attachments = if target.has_depth() { 2 } else { 1 };
        let pipeline = make_pipeline(gpu, bindings.layout(), pass.handle, attachments)?;
        Ok(Self {
            gpu: Arc::clone(gpu),
            bindings,
            pipeline,
            indices,
            state: passed.state.handle(),
            pass,
        })
    }

    /// Records the drawing of all views.
    pub(crate) fn record(&self, commands: vk::CommandBuffer, target: &Target) {
        let device = self.gpu.device();
        let point = vk::PipelineBindPoint::GRAPHICS;
        self.pass.record(commands, target, |area| {
            let viewport = vk::Viewport {
                width: pixels(area.extent.width),
                height: pixels(area.extent.height),
                max_depth: 1.0,
                ..Default::default()
            };
            self.bindings.record(commands, point, 0, &[]);
            // SAFETY: the command buffer is being recorded, within the pass that the pipeline was made for; the state
            // holds the draw's arguments.
            unsafe {
                device.cmd_bind_pipeline(commands, point, self.pipeline);
                device.cmd_set_viewport(commands, 0, &[viewport]);
                device.cmd_set_scissor(commands, 0, &[area]);
                let indices = self.indices.handle();
                device.cmd_bind_index_buffer(commands, indices, 0, vk::IndexType::UINT16);
                let arguments = offset_of!(SortState, draw) as u64;
                device.cmd_draw_indexed_indirect(commands, self.state, arguments, 1, 0);
            }
        });
    }
}

impl Drop for Quads {
    fn drop(&mut self) {
        // SAFETY: owners wait for the device before they drop.
        unsafe { self.gpu.device().destroy_pipeline(self.pipeline, None) };
    }
}

/// Two triangles for each of an instance's quads, whose corners have the numbers 4q to 4q + 3.
fn index_buffer(gpu: &Arc<Gpu>) -> Result<Buffer, RenderError> {
    let corner = |vertex: u32| u16::try_from(vertex).unwrap_or(u16::MAX);
    let indices: Vec<u16> = (0..QUADS_PER_INSTANCE)
        .flat_map(|quad| [0, 1, 2, 2, 1, 3].map(|number| corner(4 * quad + number)))
        .collect();
    let bytes = size_of_val(&indices[..]) as u64;
    let usage = vk::BufferUsageFlags::INDEX_BUFFER;
    let mut buffer = Buffer::new(gpu, "quad corners", bytes, usage, Place::Upload)?;
    buffer.write(&indices);
    Ok(buffer)
}

fn make_pipeline(
    gpu: &Gpu,
    layout: vk::PipelineLayout,
    pass: vk::RenderPass,
    attachments: usize,
) -> Result<vk::Pipeline, RenderError> {
    let vertex = Module::new(gpu, shaders_spirv::QUAD_VERT)?;
    // Writing to an attachment that is not there is nothing a pipeline should do.
    let fragment = match attachments {
        1 => shaders_spirv::QUAD_FRAG,
        _ => shaders_spirv::QUAD_DEPTH_FRAG,
    };
    let fragment = Module::new(gpu, fragment)?;
    let constants = Constants::new(&[QUADS_PER_INSTANCE]);
    let constants = constants.info();
    let stages = [
        vertex
            .stage(vk::ShaderStageFlags::VERTEX)
            .specialization_info(&constants),
        fragment.stage(vk::ShaderStageFlags::FRAGMENT),
    ];
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
    // Premultiplied "over"; the depth attachment has no alpha of its own and is blended by the one written to it.
    let over = vk::PipelineColorBlendAttachmentState::default()
        .blend_enable(true)
        .src_color_blend_factor(vk::BlendFactor::ONE)
        .dst_color_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .color_blend_op(vk::BlendOp::ADD)
        .src_alpha_blend_factor(vk::BlendFactor::ONE)
        .dst_alpha_blend_factor(vk::BlendFactor::ONE_MINUS_SRC_ALPHA)
        .alpha_blend_op(vk::BlendOp::ADD)
        .color_write_mask(vk::ColorComponentFlags::RGBA);
    let blends = [over, over];
    let blend =
        vk::PipelineColorBlendStateCreateInfo::default().attachments(&blends[..attachments]);
    let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
    let info = [vk::GraphicsPipelineCreateInfo::default()
        .stages(&stages)
        .vertex_input_state(&input)
        .input_assembly_state(&assembly)
        .viewport_state(&viewport)
        .rasterization_state(&raster)
        .multisample_state(&samples)
        .color_blend_state(&blend)
        .dynamic_state(&dynamic)
        .layout(layout)
        .render_pass(pass)];
    let device = gpu.device();
    // SAFETY: modules, layout, pass and all structures live until the call returns.
    let made = unsafe { device.create_graphics_pipelines(vk::PipelineCache::null(), &info, None) };
    let pipelines = made
        .map_err(|(_, result)| result)
        .during("vkCreateGraphicsPipelines")?;
    Ok(pipelines.first().copied().unwrap_or_default())
}

/// Pixel counts are at most 4096: exact in f32.
#[expect(clippy::cast_precision_loss, reason = "pixel counts are small")]
fn pixels(count: u32) -> f32 {
    count as f32
}
