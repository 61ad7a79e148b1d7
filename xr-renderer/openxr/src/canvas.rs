//! A canvas: a headset's next images, as a renderer draws one picture onto them.

use std::fmt;
use std::sync::Arc;

use ash::vk;
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::external_images::{BackEndSet, ExternalImages};
use renderer_splat::quad_pass::QuadPass;
use renderer_splat::target::Target;
use renderer_splat::visible_tiles::VisibleTiles;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::{EyeParams, EyeView, TILE_PIXELS};

use crate::copies::ImageLayers;
use crate::direct::DirectTarget;
use crate::error::XrError;
use crate::eyes::{EyeImages, FAR, NEAR, RenderPath, Surround, Written, is_blue_first};
use crate::frame::Eyes;
use crate::swapchain::Acquired;

/// A headset's next images, for one picture: see [`SplatRenderer::draw_onto`](renderer_splat::renderer::SplatRenderer::draw_onto).
pub struct Canvas<'a> {
    images: &'a mut EyeImages,
    eyes: Eyes,
    surround: Surround,
    reads: bool,
    colour: Acquired,
    depth: Option<Acquired>,
    // Of the picture that is drawn.
    size: vk::Extent2D,
    has_depth: bool,
    drawn: Option<DirectTarget>,
}

impl fmt::Debug for Canvas<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Canvas")
            .field("eyes", &self.eyes)
            .field("surround", &self.surround)
            .finish_non_exhaustive()
    }
}

impl ExternalImages for Canvas<'_> {
    fn prepare(
        &mut self,
        gpu: &Arc<Gpu>,
        target: &Target,
        drawers: BackEndSet,
    ) -> Result<(), RenderError> {
        if !Arc::ptr_eq(gpu, &self.images.gpu) {
            return Err(VulkanError::DeviceLost("showing another device's picture").into());
        }
        let most = self.images.colour.extent;
        let fits = target.width <= most.width && target.height <= most.height;
        if target.layers != 2 || !fits {
            return Err(RenderError::Camera {
                view: 0,
                problem: format!(
                    "it makes {} view(s) of {}x{} pixels, a headset takes 2 of at most {}x{}",
                    target.layers, target.width, target.height, most.width, most.height
                ),
            });
        }
        self.size = vk::Extent2D {
            width: target.width,
            height: target.height,
        };
        self.has_depth = target.has_depth() && self.depth.is_some();
        if let Some(mask) = &mut self.images.mask {
            let drawn = |camera: &Camera| camera.resized(target.width, target.height);
            mask.set_cameras(self.eyes.cameras.each_ref().map(drawn));
        }
        let params = self.params(target);
        self.images.params.write(&[params]);
        let strips = target
            .height
            .div_ceil(TILE_PIXELS)
            .div_ceil(params.strip_rows);
        self.images.make_ready(target, drawers)?;
        self.drawn = (self.images.direct.as_mut())
            .map(|direct| direct.prepare(self.colour, self.depth, self.size, strips))
            .transpose()?;
        Ok(())
    }

    fn visible_tiles(&self) -> Option<&[VisibleTiles; 2]> {
        self.images.mask.as_ref()?.visible_tiles()
    }

    fn pass(&self) -> Option<&Arc<QuadPass>> {
        Some(self.images.direct.as_ref()?.pass(self.drawn.as_ref()?))
    }

    fn record_direct(&self, commands: vk::CommandBuffer, draw: &dyn Fn(vk::Rect2D)) {
        if let (Some(direct), Some(drawn)) = (&self.images.direct, &self.drawn) {
            direct.record(commands, drawn, draw);
            self.record_read(commands);
        }
    }

    fn record_copied(&self, commands: vk::CommandBuffer) {
        if let Some(copies) = &self.images.copies {
            let depth = self.depth.filter(|_| self.has_depth);
            let depth = depth.map(|depth| depth.image);
            copies.record(commands, self.size, self.colour.image, depth);
            self.record_read(commands);
        }
    }

    fn finished(&mut self, direct: bool) {
        let path = match self.drawn {
            Some(DirectTarget { foveated, .. }) if direct => RenderPath::Direct { foveated },
            _ => RenderPath::Copied,
        };
        self.images.written = Some(Written {
            views: self.eyes.views,
            surround: self.surround,
            size: self.size,
            has_depth: self.has_depth,
            reads: self.reads,
            path,
        });
    }
}

impl<'a> Canvas<'a> {
    /// Takes the next images, for one picture of what these eyes see, which is read back if `reads`.
    pub(crate) fn acquire(
        images: &'a mut EyeImages,
        eyes: Eyes,
        surround: Surround,
        reads: bool,
    ) -> Result<Self, XrError> {
        let (colour, depth) = images.acquire()?;
        Ok(Self {
            reads: reads && images.read_back.is_some(),
            images,
            eyes,
            surround,
            colour,
            depth,
            size: vk::Extent2D::default(),
            has_depth: false,
            drawn: None,
        })
    }

    fn record_read(&self, commands: vk::CommandBuffer) {
        if let Some(buffer) = self.images.read_back.as_ref().filter(|_| self.reads) {
            let layers = ImageLayers {
                image: self.colour.image,
                aspect: vk::ImageAspectFlags::COLOR,
                rest: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
                size: self.size,
            };
            layers.record_read(&self.images.gpu, commands, buffer);
        }
    }

    fn params(&self, target: &Target) -> EyeParams {
        let format = self.images.colour.format;
        let view = |camera: &Camera| eye_view(camera, target);
        let visible = self.visible_tiles();
        let (width, height) = (target.width, target.height);
        EyeParams {
            views: self.eyes.cameras.each_ref().map(view),
            width,
            height,
            depth_stride: if self.has_depth {
                target.depth_stride()
            } else {
                0
            },
            surround: self.surround.number(),
            swaps_red: u32::from(is_blue_first(format)),
            linear: u32::from(is_linear(format)),
            near: NEAR,
            far: FAR,
            strip_rows: strip_rows(target, visible.is_some()),
            padding: [0; 3],
            visible_rows: match visible {
                Some(views) => VisibleTiles::rows(views),
                None => VisibleTiles::rows(&[(); 2].map(|()| VisibleTiles::all(width, height))),
            },
        }
    }
}

/// Rows of tiles in a strip of the picture: all, where all of it is seen. What lies on a strip's diagonal is shaded twice, of which many
/// strips have more than they hide.
fn strip_rows(target: &Target, masked: bool) -> u32 {
    const MASKED_STRIPS: u32 = 28;
    let rows = target.height.div_ceil(TILE_PIXELS);
    if masked {
        rows.div_ceil(MASKED_STRIPS)
    } else {
        rows
    }
}

fn eye_view(camera: &Camera, target: &Target) -> EyeView {
    let world_from_eye = camera.camera_from_world.inverse();
    let row = |row: usize| {
        let [x, y, z] = world_from_eye.matrix3.row(row).to_array();
        [x, y, z, world_from_eye.translation[row]]
    };
    // The camera's view does not depend on the number of pixels.
    let wide = camera.width as f32 / camera.fx;
    let high = camera.height as f32 / camera.fy;
    EyeView {
        world_from_eye: [row(0), row(1), row(2)],
        slopes: [
            -camera.cx / camera.fx,
            camera.cy / camera.fy,
            wide / target.width as f32,
            -high / target.height as f32,
        ],
    }
}

fn is_linear(format: vk::Format) -> bool {
    matches!(
        format,
        vk::Format::R8G8B8A8_UNORM | vk::Format::B8G8R8A8_UNORM
    )
}
