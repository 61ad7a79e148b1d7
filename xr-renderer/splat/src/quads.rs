//! The quad back end: one tight oriented hexagon for each splat, farthest first, blended by fixed function.
//!
//! Nothing is stored per tile, which suits tile-based GPUs; every fragment of every splat is blended, though, hidden or not.

use std::mem::offset_of;
use std::sync::Arc;

use ash::vk;
use renderer_vulkan::bindings::{Bindings, Resource};
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::graphics::{GraphicsPipeline, GraphicsPipelineInfo};
use renderer_vulkan::pipeline::{Constants, Module};
use shaders_spirv::{QUADS_PER_INSTANCE, SortState};

use crate::geometry_pass::GeometryPass;
use crate::quad_pass::{QuadPass, TargetPass};
use crate::target::Target;

/// Pipelines and what they read, and the pass of the renderer's own target.
pub(crate) struct Quads {
    gpu: Arc<Gpu>,
    /// One for each pass that is drawn in, the own one first.
    pipelines: Vec<(Arc<QuadPass>, GraphicsPipeline)>,
    bindings: Bindings,
    indices: Buffer,
    state: vk::Buffer,
    own: TargetPass,
}

impl Quads {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        geometry: &GeometryPass,
        target: &Target,
    ) -> Result<Self, VulkanError> {
        let own = TargetPass::new(gpu, target)?;
        let shared = geometry.shared_buffers();
        let [left, right] = &shared.splats;
        let storage = [left, right, &shared.rects, geometry.order(), &shared.state];
        let resources: Vec<_> = std::iter::once(Resource::Uniform(&shared.frame))
            .chain(storage.map(Resource::Storage))
            .collect();
        let bindings = Bindings::new(gpu, vk::ShaderStageFlags::VERTEX, 0, 1, &resources)?;
        let mut made = Self {
            gpu: Arc::clone(gpu),
            pipelines: Vec::new(),
            bindings,
            indices: index_buffer(gpu)?,
            state: shared.state.handle(),
            own,
        };
        let pass = Arc::clone(&made.own.pass);
        made.prepare(&pass)?;
        Ok(made)
    }

    /// Makes sure that [`Self::record_within`] can draw in this pass. The device is idle.
    pub(crate) fn prepare(&mut self, pass: &Arc<QuadPass>) -> Result<(), VulkanError> {
        if self.pipeline(pass).is_some() {
            return Ok(());
        }
        // Passes without another owner are no longer used.
        self.pipelines
            .retain(|(pass, _)| Arc::strong_count(pass) > 1);
        let made = make_pipeline(&self.gpu, self.bindings.layout(), pass)?;
        self.pipelines.push((Arc::clone(pass), made));
        Ok(())
    }

    fn pipeline(&self, pass: &Arc<QuadPass>) -> Option<&GraphicsPipeline> {
        let mut made = self.pipelines.iter();
        made.find(|(other, _)| Arc::ptr_eq(other, pass))
            .map(|(_, pipeline)| pipeline)
    }

    /// Records the drawing of all views into the target.
    pub(crate) fn record(&self, commands: vk::CommandBuffer, target: &Target) {
        self.own.record(commands, target, |area| {
            self.record_within(commands, &self.own.pass, area);
        });
    }

    /// Records the drawing of all views, over an area, within a pass that was prepared and is being recorded.
    pub(crate) fn record_within(
        &self,
        commands: vk::CommandBuffer,
        pass: &Arc<QuadPass>,
        area: vk::Rect2D,
    ) {
        debug_assert!(self.pipeline(pass).is_some(), "a pass that was prepared");
        let Some(pipeline) = self.pipeline(pass) else {
            return;
        };
        let device = self.gpu.device();
        let point = vk::PipelineBindPoint::GRAPHICS;
        pipeline.record(commands, area);
        self.bindings.record(commands, point, 0, &[]);
        // SAFETY: the command buffer is being recorded; the state holds the draw's arguments.
        unsafe {
            let indices = self.indices.handle();
            device.cmd_bind_index_buffer(commands, indices, 0, vk::IndexType::UINT16);
            let arguments = offset_of!(SortState, draw) as u64;
            device.cmd_draw_indexed_indirect(commands, self.state, arguments, 1, 0);
        }
    }
}

/// Four triangles for each of an instance's hexagons, whose corners have the numbers 6h to 6h + 5, around: one in the middle, since long thin ones
/// share more pixels.
fn index_buffer(gpu: &Arc<Gpu>) -> Result<Buffer, VulkanError> {
    let corner = |vertex: u32| u16::try_from(vertex).unwrap_or(u16::MAX);
    let indices: Vec<u16> = (0..QUADS_PER_INSTANCE)
        .flat_map(|hexagon| {
            [0, 2, 4, 0, 1, 2, 2, 3, 4, 4, 5, 0].map(|number| corner(6 * hexagon + number))
        })
        .collect();
    let bytes = size_of_val(&indices[..]) as u64;
    let usage = vk::BufferUsageFlags::INDEX_BUFFER;
    let mut buffer = Buffer::new(gpu, "quad corners", bytes, usage, MemoryUsage::Upload)?;
    buffer.write(&indices);
    Ok(buffer)
}

fn make_pipeline(
    gpu: &Arc<Gpu>,
    layout: vk::PipelineLayout,
    pass: &QuadPass,
) -> Result<GraphicsPipeline, VulkanError> {
    let vertex = Module::new(gpu, shaders_spirv::QUAD_VERT.words)?;
    // A pipeline must not write to an attachment that does not exist.
    let (fragment, attachments) = if pass.with_depth() {
        (shaders_spirv::QUAD_DEPTH_FRAG.words, 2)
    } else {
        (shaders_spirv::QUAD_FRAG.words, 1)
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
    GraphicsPipeline::new(
        gpu,
        &GraphicsPipelineInfo {
            stages: &stages,
            blends: &blends[..attachments],
            writes_depth: false,
            layout,
            pass: pass.render_pass().handle(),
            subpass: 0,
        },
    )
}
