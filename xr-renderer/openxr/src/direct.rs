//! Draws quads directly into a headset's images: both eyes in one pass, coarser where a density map says so.
//!
//! A density map covers the whole images, not the part that is drawn, so pictures of less than full size are drawn without one.

use std::sync::Arc;

use ash::vk;
use renderer_splat::quad_pass::{DEPTH, PICTURE, QuadPass};
use renderer_vulkan::attachment::{Attachment, AttachmentUse, View};
use renderer_vulkan::bindings::{Bindings, Resource};
use renderer_vulkan::buffer::Buffer;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use renderer_vulkan::graphics::{GraphicsPipeline, GraphicsPipelineInfo};
use renderer_vulkan::pipeline::Module;
use renderer_vulkan::render_pass::Framebuffer;

use crate::pass::PassKind;
use crate::swapchain::{Acquired, Swapchain};

/// Eyes, each with its layer.
const LAYERS: u32 = 2;
/// Of a runtime's density maps, always.
const MAP: vk::Format = vk::Format::R8G8_UNORM;

/// The passes that draw quads into one swapchain's images, and into another's depth images.
pub(crate) struct Direct {
    gpu: Arc<Gpu>,
    framebuffers: Vec<(FramebufferKey, Framebuffer)>,
    plain: EyePass,
    /// Where there are density maps.
    foveated: Option<EyePass>,
    bindings: Bindings,
    picture: Attachment,
    depth: Option<Attachment>,
    colours: Vec<View>,
    depths: Vec<View>,
    maps: Vec<View>,
    extent: vk::Extent2D,
}

/// Images that are drawn into together, and whether with their density map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct FramebufferKey {
    colour: usize,
    depth: Option<usize>,
    foveated: bool,
}

/// A pass, and the pipeline of its second part.
struct EyePass {
    pass: Arc<QuadPass>,
    pipeline: GraphicsPipeline,
}

/// The pass and area that one picture is drawn in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DirectTarget {
    framebuffer: vk::Framebuffer,
    area: vk::Rect2D,
    strips: u32,
    pub(crate) foveated: bool,
}

impl Direct {
    /// For these images, made to be drawn into, of which `depth` has as many pixels as `colour`.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        colour: &Swapchain,
        depth: Option<&Swapchain>,
        params: &Buffer,
    ) -> Result<Self, VulkanError> {
        let extent = colour.extent;
        let passing = |what, format| {
            Attachment::new(gpu, what, format, extent, LAYERS, AttachmentUse::Transient)
        };
        let picture = passing("the quads' picture on its way to the eyes", PICTURE)?;
        let passing_depth = depth
            .map(|_| passing("the quads' depth on its way to the eyes", DEPTH))
            .transpose()?;
        let resources: Vec<_> = [Resource::Uniform(params), Resource::Input(&picture)]
            .into_iter()
            .chain(passing_depth.as_ref().map(Resource::Input))
            .collect();
        let stages = vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT;
        let bindings = Bindings::new(gpu, stages, 0, 1, &resources)?;
        let kind = PassKind {
            colour: colour.format,
            depth: depth.map(|depth| depth.format),
            foveated: false,
        };
        let eye_pass = |foveated| EyePass::new(gpu, PassKind { foveated, ..kind }, &bindings);
        let views = |images: &[vk::Image], format| -> Result<Vec<_>, VulkanError> {
            let view = |image: &vk::Image| View::new(gpu, *image, format, LAYERS);
            images.iter().map(view).collect()
        };
        let maps: Vec<_> = colour.maps.iter().map(|map| map.image).collect();
        Ok(Self {
            gpu: Arc::clone(gpu),
            framebuffers: Vec::new(),
            plain: eye_pass(false)?,
            foveated: (!maps.is_empty()).then(|| eye_pass(true)).transpose()?,
            picture,
            depth: passing_depth,
            colours: views(colour.images(), colour.format)?,
            depths: depth.map_or(Ok(Vec::new()), |depth| views(depth.images(), depth.format))?,
            maps: views(&maps, MAP)?,
            bindings,
            extent,
        })
    }

    /// Whether depth is drawn.
    pub(crate) fn has_depth(&self) -> bool {
        self.depth.is_some()
    }

    /// Prepares for a picture of `size`, shown in so many strips, in the upper left of these images, which were made for this.
    pub(crate) fn prepare(
        &mut self,
        colour: Acquired,
        depth: Option<Acquired>,
        size: vk::Extent2D,
        strips: u32,
    ) -> Result<DirectTarget, VulkanError> {
        let foveated = self.foveated.is_some() && size == self.extent;
        let place = FramebufferKey {
            colour: colour.index,
            depth: depth.filter(|_| self.has_depth()).map(|depth| depth.index),
            foveated,
        };
        let made = self.framebuffers.iter().find(|(at, _)| *at == place);
        let framebuffer = match made {
            Some((_, framebuffer)) => framebuffer.handle(),
            None => {
                let made = self.framebuffer(place)?;
                let handle = made.handle();
                self.framebuffers.push((place, made));
                handle
            }
        };
        Ok(DirectTarget {
            framebuffer,
            area: size.into(),
            strips,
            foveated,
        })
    }

    fn framebuffer(&self, place: FramebufferKey) -> Result<Framebuffer, VulkanError> {
        let views = [
            Some(&self.picture.view),
            self.depth.as_ref().map(|it| &it.view),
        ]
        .into_iter()
        .chain([
            self.colours.get(place.colour),
            place.depth.and_then(|index| self.depths.get(index)),
            self.maps.get(place.colour).filter(|_| place.foveated),
        ])
        .flatten();
        let pass = self.eye_pass(place.foveated).pass.render_pass();
        Framebuffer::new(pass, views, self.extent)
    }

    /// The pass that draws there.
    pub(crate) fn pass(&self, drawn: &DirectTarget) -> &Arc<QuadPass> {
        &self.eye_pass(drawn.foveated).pass
    }

    fn eye_pass(&self, foveated: bool) -> &EyePass {
        self.foveated
            .as_ref()
            .filter(|_| foveated)
            .unwrap_or(&self.plain)
    }

    /// Records the pass, with what `draw` records in its first part.
    pub(crate) fn record(
        &self,
        commands: vk::CommandBuffer,
        drawn: &DirectTarget,
        draw: &dyn Fn(vk::Rect2D),
    ) {
        let EyePass { pass, pipeline } = self.eye_pass(drawn.foveated);
        // For the quads' picture, their depth and the eyes' picture, all transparent; for the eyes' depth, far.
        let mut clear = [vk::ClearValue::default(); 4];
        clear[3].depth_stencil.depth = 1.0;
        let begin = vk::RenderPassBeginInfo::default()
            .render_pass(pass.render_pass().handle())
            .framebuffer(drawn.framebuffer)
            .render_area(drawn.area)
            .clear_values(&clear);
        let device = self.gpu.device();
        let inline = vk::SubpassContents::INLINE;
        let point = vk::PipelineBindPoint::GRAPHICS;
        // SAFETY: the command buffer is being recorded; pass and framebuffer fit.
        unsafe { device.cmd_begin_render_pass(commands, &begin, inline) };
        draw(drawn.area);
        // SAFETY: the pass is being recorded, and has a second part.
        unsafe { device.cmd_next_subpass(commands, inline) };
        pipeline.record(commands, drawn.area);
        self.bindings.record(commands, point, 0, &[]);
        // SAFETY: as above; the vertex shader reads no buffers but those that are bound.
        unsafe {
            device.cmd_draw(commands, 6, drawn.strips, 0, 0);
            device.cmd_end_render_pass(commands);
        }
    }
}

impl EyePass {
    fn new(gpu: &Arc<Gpu>, kind: PassKind, bindings: &Bindings) -> Result<Self, VulkanError> {
        let pass = kind.pass(gpu)?;
        let vertex = Module::new(gpu, shaders_spirv::SHOW_EYE_VERT.words)?;
        let fragment = if pass.with_depth() {
            shaders_spirv::SHOW_EYE_DEPTH_FRAG.words
        } else {
            shaders_spirv::SHOW_EYE_FRAG.words
        };
        let fragment = Module::new(gpu, fragment)?;
        let stages = [
            vertex.stage(vk::ShaderStageFlags::VERTEX),
            fragment.stage(vk::ShaderStageFlags::FRAGMENT),
        ];
        let written = vk::PipelineColorBlendAttachmentState::default()
            .color_write_mask(vk::ColorComponentFlags::RGBA);
        let triangles = GraphicsPipelineInfo {
            stages: &stages,
            blends: &[written],
            writes_depth: pass.with_depth(),
            layout: bindings.layout(),
            pass: pass.render_pass().handle(),
            subpass: 1,
        };
        let pipeline = GraphicsPipeline::new(gpu, &triangles)?;
        Ok(Self {
            pass: Arc::new(pass),
            pipeline,
        })
    }
}
