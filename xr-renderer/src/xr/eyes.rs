//! From the splatted picture to a headset's images: what surrounds the person, the compositor's colours and depths, the copies.

use std::sync::Arc;

use ash::vk;
use openxr::{Session, SwapchainUsageFlags, Vulkan};

use super::error::{XrContext, XrError};
use super::frame::Eyes;
use super::swapchain::{Kind, Swapchain, first_common};
use crate::bindings::Resource;
use crate::buffer::{Buffer, Place};
use crate::camera::Camera;
use crate::commands::{Commands, barrier};
use crate::error::RenderError;
use crate::gpu::Gpu;
use crate::pipeline::{ComputePipeline, Specialisation};
use crate::splat::SplatRenderer;
use crate::target::Target;

const GROUP: u32 = 64;
/// Of `EyeParams` in the shader.
const PUSH_WORDS: usize = 26;
const PUSH_BYTES: u32 = 104;

/// Depth 0 and 1 of the compositor's depth images, metres from the eye along its axis.
pub(crate) const NEAR: f32 = 0.05;
pub(crate) const FAR: f32 = 100.0;

/// Colours in the sRGB curve first: there the compositor finds light, and 8 bits are enough for it.
const COLOURS: [vk::Format; 4] = [
    vk::Format::R8G8B8A8_SRGB,
    vk::Format::B8G8R8A8_SRGB,
    vk::Format::R8G8B8A8_UNORM,
    vk::Format::B8G8R8A8_UNORM,
];
const DEPTHS: [vk::Format; 1] = [vk::Format::D32_SFLOAT];

/// What stands around and behind the person.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Surround {
    /// The viewer's own room, where the headset shows it.
    Room,
    /// A plain floor at y = 0 and a wall far away.
    Studio,
    /// Darkness: the renderer's background is the scene.
    Scene,
}

impl Surround {
    /// As the shader's constants.
    fn number(self) -> u32 {
        match self {
            Self::Room => 0,
            Self::Studio => 1,
            Self::Scene => 2,
        }
    }
}

/// An eye's picture as the compositor got it: 8-bit RGBA in the sRGB curve, premultiplied as light.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EyePicture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row by row from the top.
    pub rgba: Vec<u8>,
}

/// A headset's images, and the way into them.
pub(crate) struct EyeImages {
    // Dropped first: waits for the device.
    commands: Commands,
    pub(crate) colour: Swapchain,
    pub(crate) depth: Option<Swapchain>,
    format: vk::Format,
    pipeline: Option<ComputePipeline>,
    /// The renderer's buffers that the pipeline reads.
    bound: [vk::Buffer; 2],
    pixels: Buffer,
    depths: Buffer,
    read_back: Option<Buffer>,
    /// The size of what was written last, and whether its depth was.
    written: (vk::Extent2D, bool),
    gpu: Arc<Gpu>,
}

impl EyeImages {
    /// Images of `extent` for each eye, with depth where it is wanted and the runtime has a format for it.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        session: &Session<Vulkan>,
        extent: vk::Extent2D,
        with_depth: bool,
        with_read_back: bool,
    ) -> Result<Self, XrError> {
        let offered = session
            .enumerate_swapchain_formats()
            .during("xrEnumerateSwapchainFormats")?;
        let format = first_common(&COLOURS, &offered).ok_or_else(|| XrError::Unsupported {
            runtime: "the OpenXR runtime".to_owned(),
            lacks: "images of 8-bit colours".to_owned(),
        })?;
        let mut usage = SwapchainUsageFlags::COLOR_ATTACHMENT
            | SwapchainUsageFlags::SAMPLED
            | SwapchainUsageFlags::TRANSFER_DST;
        if with_read_back {
            usage |= SwapchainUsageFlags::TRANSFER_SRC;
        }
        let kind = Kind {
            format,
            extent,
            layers: 2,
            usage,
        };
        let colour = Swapchain::new(gpu, session, kind)?;
        let depth = match first_common(&DEPTHS, &offered).filter(|_| with_depth) {
            Some(format) => {
                let usage = SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT
                    | SwapchainUsageFlags::SAMPLED
                    | SwapchainUsageFlags::TRANSFER_DST;
                Some(Swapchain::new(
                    gpu,
                    session,
                    Kind {
                        format,
                        usage,
                        ..kind
                    },
                )?)
            }
            None => None,
        };
        let bytes = u64::from(extent.width) * u64::from(extent.height) * 4 * 2;
        let depth_bytes = if depth.is_some() { bytes } else { 0 };
        let read_back = with_read_back
            .then(|| {
                let usage = vk::BufferUsageFlags::empty();
                Buffer::new(gpu, "the eyes' read-back", bytes, usage, Place::ReadBack)
            })
            .transpose()?;
        Ok(Self {
            pixels: Buffer::storage(gpu, "the eyes' pixels", bytes)?,
            depths: Buffer::storage(gpu, "the eyes' depths", depth_bytes)?,
            read_back,
            commands: Commands::new(gpu)?,
            colour,
            depth,
            format,
            pipeline: None,
            bound: [vk::Buffer::null(); 2],
            written: (vk::Extent2D::default(), false),
            gpu: Arc::clone(gpu),
        })
    }

    /// What is to be shown of the images: the size of the last picture, and whether it has depth.
    pub(crate) fn written(&self) -> (vk::Extent2D, bool) {
        self.written
    }

    /// Writes the renderer's last picture, seen by `eyes`, to the next images and gives them to the compositor. Returns both
    /// eyes' pictures where they are to be read.
    pub(crate) fn write(
        &mut self,
        renderer: &SplatRenderer,
        eyes: &Eyes,
        surround: Surround,
        reads: bool,
    ) -> Result<Option<[EyePicture; 2]>, XrError> {
        let target = renderer.target()?;
        if !Arc::ptr_eq(renderer.gpu(), &self.gpu) {
            return Err(RenderError::DeviceLost("showing another device's picture").into());
        }
        // The last picture's copies may still read what is written and bound anew here.
        self.commands.settle()?;
        self.bind(target)?;
        let size = vk::Extent2D {
            width: target.width.min(self.colour.extent.width),
            height: target.height.min(self.colour.extent.height),
        };
        let has_depth = target.has_depth() && self.depth.is_some();
        let image = self.colour.acquire()?;
        let depth_image = match &mut self.depth {
            Some(depth) if has_depth => Some(depth.acquire()?),
            _ => None,
        };
        let read_back = self.read_back.as_ref().filter(|_| reads);
        let Some(pipeline) = &self.pipeline else {
            return Err(RenderError::DeviceLost("making a pipeline").into());
        };
        let gpu = &self.gpu;
        let submitted = self.commands.submit("showing to the eyes", |commands| {
            for (view, camera) in (0..).zip(&eyes.cameras) {
                let push = push_words(target, size, camera, view, surround, self.format, has_depth);
                let groups = [size.width.div_ceil(GROUP), size.height, 1];
                pipeline.dispatch(commands, &push, groups);
            }
            barrier(gpu, commands);
            let colour = Copied {
                image,
                aspect: vk::ImageAspectFlags::COLOR,
                left_in: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
                size,
            };
            colour.record(gpu, commands, &self.pixels, read_back);
            if let Some(image) = depth_image {
                let depth = Copied {
                    image,
                    aspect: vk::ImageAspectFlags::DEPTH,
                    left_in: vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
                    size,
                };
                depth.record(gpu, commands, &self.depths, None);
            }
        });
        self.colour.release()?;
        if let (Some(_), Some(depth)) = (depth_image, &mut self.depth) {
            depth.release()?;
        }
        submitted?;
        self.written = (size, has_depth);
        let Some(buffer) = &self.read_back else {
            return Ok(None);
        };
        if !reads {
            return Ok(None);
        }
        self.commands.settle()?;
        let bytes: Vec<u8> = buffer.read(size.width as usize * size.height as usize * 8);
        Ok(Some(self.pictures(size, &bytes)))
    }

    fn pictures(&self, size: vk::Extent2D, bytes: &[u8]) -> [EyePicture; 2] {
        let (left, right) = bytes.split_at(bytes.len() / 2);
        let blue_first = is_blue_first(self.format);
        [left, right].map(|bytes| {
            let mut rgba = bytes.to_vec();
            if blue_first {
                for pixel in rgba.chunks_exact_mut(4) {
                    pixel.swap(0, 2);
                }
            }
            EyePicture {
                width: size.width,
                height: size.height,
                rgba,
            }
        })
    }

    /// Makes the pipeline read this target. The device is idle.
    fn bind(&mut self, target: &Target) -> Result<(), XrError> {
        let buffers = [target.buffer.handle(), target.depth.handle()];
        let resources =
            [&target.buffer, &target.depth, &self.pixels, &self.depths].map(Resource::Storage);
        match &mut self.pipeline {
            Some(_) if self.bound == buffers => {}
            Some(pipeline) => pipeline.bind(&resources),
            None => {
                let specialisation = Specialisation {
                    constants: &[GROUP],
                    push_bytes: PUSH_BYTES,
                    ..Default::default()
                };
                self.pipeline = Some(ComputePipeline::new(
                    &self.gpu,
                    shaders_spirv::COMPOSE_EYE,
                    specialisation,
                    &resources,
                )?);
            }
        }
        self.bound = buffers;
        Ok(())
    }
}

/// An image that both eyes' layers are copied to.
struct Copied {
    image: vk::Image,
    aspect: vk::ImageAspectFlags,
    /// What the compositor expects it to be left in.
    left_in: vk::ImageLayout,
    size: vk::Extent2D,
}

impl Copied {
    fn record(
        &self,
        gpu: &Gpu,
        commands: vk::CommandBuffer,
        from: &Buffer,
        read_back: Option<&Buffer>,
    ) {
        use vk::{AccessFlags as Access, ImageLayout as Layout, PipelineStageFlags as Stage};
        let range = vk::ImageSubresourceRange {
            aspect_mask: self.aspect,
            level_count: 1,
            layer_count: 2,
            ..Default::default()
        };
        let change = |from: Layout, to: Layout, written: Access, used: Access| {
            [vk::ImageMemoryBarrier::default()
                .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
                .image(self.image)
                .subresource_range(range)
                .old_layout(from)
                .new_layout(to)
                .src_access_mask(written)
                .dst_access_mask(used)]
        };
        let vk::Extent2D { width, height } = self.size;
        let layer_bytes = u64::from(width) * u64::from(height) * 4;
        let regions = [0, 1].map(|layer| {
            vk::BufferImageCopy::default()
                .buffer_offset(layer_bytes * u64::from(layer))
                .image_subresource(vk::ImageSubresourceLayers {
                    aspect_mask: self.aspect,
                    mip_level: 0,
                    base_array_layer: layer,
                    layer_count: 1,
                })
                .image_extent(vk::Extent3D {
                    width,
                    height,
                    depth: 1,
                })
        });
        let writable = change(
            Layout::UNDEFINED,
            Layout::TRANSFER_DST_OPTIMAL,
            Access::empty(),
            Access::TRANSFER_WRITE,
        );
        let mut last = (Layout::TRANSFER_DST_OPTIMAL, Access::TRANSFER_WRITE);
        let device = gpu.device();
        let none = vk::DependencyFlags::empty();
        // SAFETY: the command buffer is being recorded; the image was acquired and its compositor waited for; the buffers hold
        // as many bytes as the regions, which lie within the image.
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
                from.handle(),
                self.image,
                Layout::TRANSFER_DST_OPTIMAL,
                &regions,
            );
            if let Some(to) = read_back {
                let readable = change(
                    Layout::TRANSFER_DST_OPTIMAL,
                    Layout::TRANSFER_SRC_OPTIMAL,
                    Access::TRANSFER_WRITE,
                    Access::TRANSFER_READ,
                );
                device.cmd_pipeline_barrier(
                    commands,
                    Stage::TRANSFER,
                    Stage::TRANSFER,
                    none,
                    &[],
                    &[],
                    &readable,
                );
                device.cmd_copy_image_to_buffer(
                    commands,
                    self.image,
                    Layout::TRANSFER_SRC_OPTIMAL,
                    to.handle(),
                    &regions,
                );
                barrier(gpu, commands);
                last = (Layout::TRANSFER_SRC_OPTIMAL, Access::TRANSFER_READ);
            }
            let showable = change(last.0, self.left_in, last.1, Access::MEMORY_READ);
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
    }
}

fn is_blue_first(format: vk::Format) -> bool {
    matches!(
        format,
        vk::Format::B8G8R8A8_SRGB | vk::Format::B8G8R8A8_UNORM
    )
}

fn is_linear(format: vk::Format) -> bool {
    matches!(
        format,
        vk::Format::R8G8B8A8_UNORM | vk::Format::B8G8R8A8_UNORM
    )
}

/// `EyeParams` in `shaders/compose_eye.comp`, as words.
fn push_words(
    target: &Target,
    size: vk::Extent2D,
    camera: &Camera,
    view: u32,
    surround: Surround,
    format: vk::Format,
    has_depth: bool,
) -> [u32; PUSH_WORDS] {
    let world_from_eye = camera.camera_from_world.inverse();
    let mut words = [0; PUSH_WORDS];
    let mut at = 0;
    let mut put = |values: &[u32]| {
        for value in values {
            if let Some(word) = words.get_mut(at) {
                *word = *value;
            }
            at += 1;
        }
    };
    for row in 0..3 {
        let axis = world_from_eye.matrix3.row(row);
        put(&axis.to_array().map(f32::to_bits));
        put(&[world_from_eye.translation[row].to_bits()]);
    }
    // What the camera sees does not depend on how many pixels show it.
    let wide = camera.width as f32 / camera.fx;
    let high = camera.height as f32 / camera.fy;
    put(&[
        -camera.cx / camera.fx,
        camera.cy / camera.fy,
        wide / target.width as f32,
        -high / target.height as f32,
    ]
    .map(f32::to_bits));
    let pixels = target.width * target.height;
    let depths = target.depth_stride() * target.height;
    put(&[
        size.width,
        size.height,
        view * pixels,
        view * depths,
        if has_depth { target.depth_stride() } else { 0 },
        surround.number(),
        u32::from(is_blue_first(format)),
        u32::from(is_linear(format)),
        NEAR.to_bits(),
        FAR.to_bits(),
    ]);
    words
}
