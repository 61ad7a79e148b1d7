//! A headset's images, one layer for each eye, and the renderer's two paths into them: quads are drawn directly, what compute
//! drew is composed and copied.

use std::fmt;
use std::sync::Arc;

use ash::vk;
use openxr::{Session, SwapchainUsageFlags as Usage, View, Vulkan};
use renderer_splat::external_images::BackEndSet;
use renderer_splat::target::Target;
use renderer_vulkan::buffer::{Buffer, MemoryUsage};
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::EyeParams;

use crate::copies::Copies;
use crate::direct::Direct;
use crate::error::{XrContext, XrError};
use crate::ext::foveation::Foveation;
use crate::ext::visibility_mask::VisibilityMask;
use crate::swapchain::{Acquired, Swapchain, SwapchainKind, first_common};

/// Depth 0 and 1 of the compositor's depth images, metres from the eye along its axis.
pub(crate) const NEAR: f32 = 0.05;
pub(crate) const FAR: f32 = 100.0;

/// Colours in the sRGB curve first: the compositor then blends linear light, for which 8 bits suffice.
const COLOURS: [vk::Format; 4] = [
    vk::Format::R8G8B8A8_SRGB,
    vk::Format::B8G8R8A8_SRGB,
    vk::Format::R8G8B8A8_UNORM,
    vk::Format::B8G8R8A8_UNORM,
];
const DEPTHS: [vk::Format; 1] = [vk::Format::D32_SFLOAT];

/// What surrounds the people.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Surround {
    /// The viewer's own room, where the headset shows it.
    Room,
    /// A plain floor at y = 0 and a wall far away.
    Studio,
    /// Darkness around the renderer's background scene.
    Scene,
}

impl Surround {
    /// As the shaders' constants.
    pub(crate) fn number(self) -> u32 {
        match self {
            Self::Room => 0,
            Self::Studio => 1,
            Self::Scene => 2,
        }
    }
}

/// An eye's picture as submitted to the compositor: 8-bit RGBA in the sRGB curve, premultiplied as light.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EyePicture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row by row from the top.
    pub rgba: Vec<u8>,
}

/// How a picture was written into a headset's images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RenderPath {
    /// Drawn into the renderer's target, composed and copied.
    Copied,
    /// Drawn directly into them.
    Direct {
        /// Whether it was foveated.
        foveated: bool,
    },
}

impl fmt::Display for RenderPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Copied => "composed and copied",
            Self::Direct { foveated: false } => "drawn straight into the headset's images",
            Self::Direct { foveated: true } => "drawn straight into the headset's images, foveated",
        })
    }
}

/// A picture in the images, as it is submitted to the compositor.
#[derive(Clone, Copy)]
pub(crate) struct Written {
    pub(crate) views: [View; 2],
    pub(crate) surround: Surround,
    pub(crate) size: vk::Extent2D,
    pub(crate) has_depth: bool,
    pub(crate) reads: bool,
    pub(crate) path: RenderPath,
}

/// A picture that was given to the compositor.
pub(crate) struct Released {
    pub(crate) written: Written,
    /// Both eyes', where reading was asked for.
    pub(crate) pictures: Option<[EyePicture; 2]>,
}

/// A headset's images, and what draws or copies pictures into them.
pub(crate) struct EyeImages {
    // Dropped before the images that it refers to.
    pub(crate) direct: Option<Direct>,
    pub(crate) copies: Option<Copies>,
    pub(crate) params: Buffer,
    pub(crate) read_back: Option<Buffer>,
    pub(crate) colour: Swapchain,
    pub(crate) depth: Option<Swapchain>,
    foveation: Option<Foveation>,
    /// What the lenses hide of the pictures, where the runtime tells.
    pub(crate) mask: Option<VisibilityMask>,
    /// Whether the runtime's images can be drawn into, and the device has the memory for it.
    can_draw: bool,
    /// Since the images were acquired last.
    pub(crate) written: Option<Written>,
    path: Option<RenderPath>,
    pub(crate) gpu: Arc<Gpu>,
}

impl EyeImages {
    /// Images of `extent` for each eye, with depth where it is wanted and the runtime has a format for it.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        session: &Session<Vulkan>,
        foveation: Option<Foveation>,
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
        let mut copied = Usage::SAMPLED | Usage::TRANSFER_DST;
        if with_read_back {
            copied |= Usage::TRANSFER_SRC;
        }
        let made = |format, attachment, copied, foveation| {
            let kind = |usage| SwapchainKind {
                format,
                extent,
                layers: 2,
                usage,
            };
            match Swapchain::foveated(gpu, session, kind(copied | attachment), foveation) {
                Err(XrError::Call { call, result }) => {
                    log::info!("pictures are copied to the headset's images: {call}: {result}");
                    let copied = Swapchain::new(gpu, session, kind(copied))?;
                    Ok((copied, false))
                }
                drawn => drawn.map(|drawn| (drawn, true)),
            }
        };
        let attachment = Usage::COLOR_ATTACHMENT;
        let (colour, mut can_draw) = made(format, attachment, copied, foveation.as_ref())?;
        let depth = match first_common(&DEPTHS, &offered).filter(|_| with_depth) {
            Some(format) => {
                let copied = Usage::SAMPLED | Usage::TRANSFER_DST;
                let (depth, drawn) = made(format, Usage::DEPTH_STENCIL_ATTACHMENT, copied, None)?;
                can_draw &= drawn;
                Some(depth)
            }
            None => None,
        };
        let bytes = u64::from(extent.width) * u64::from(extent.height) * 4 * 2;
        let read_back = with_read_back
            .then(|| {
                let usage = vk::BufferUsageFlags::empty();
                Buffer::new(
                    gpu,
                    "the eyes' read-back",
                    bytes,
                    usage,
                    MemoryUsage::ReadBack,
                )
            })
            .transpose()?;
        let params = size_of::<EyeParams>() as u64;
        let uniform = vk::BufferUsageFlags::UNIFORM_BUFFER;
        Ok(Self {
            direct: None,
            copies: None,
            params: Buffer::new(
                gpu,
                "the eyes' parameters",
                params,
                uniform,
                MemoryUsage::Upload,
            )?,
            read_back,
            foveation: foveation.filter(|_| !colour.maps.is_empty()),
            mask: None,
            colour,
            depth,
            can_draw,
            written: None,
            path: None,
            gpu: Arc::clone(gpu),
        })
    }

    /// Whether foveation follows the viewer's gaze.
    pub(crate) fn follows_gaze(&self) -> bool {
        (self.foveation.as_ref()).is_some_and(Foveation::follows_gaze)
    }

    /// How the last picture came into the images; nothing before the first.
    pub(crate) fn render_path(&self) -> Option<RenderPath> {
        self.path
    }

    /// Takes the next images of colour and, where there are any, of depth.
    pub(crate) fn acquire(&mut self) -> Result<(Acquired, Option<Acquired>), XrError> {
        self.written = None;
        let colour = self.colour.acquire()?;
        let depth = self.depth.as_mut().map(Swapchain::acquire).transpose()?;
        if let Some(foveation) = &self.foveation {
            foveation.follow_gaze(&self.colour.handle);
        }
        Ok((colour, depth))
    }

    /// Gives the images that were taken to the compositor. Returns what was written to them, if anything was.
    pub(crate) fn release(&mut self) -> Result<Option<Released>, XrError> {
        let released = self.colour.release_if_held();
        if let Some(depth) = &mut self.depth {
            depth.release_if_held()?;
        }
        released?;
        let Some(written) = self.written.take() else {
            return Ok(None);
        };
        if self.path.replace(written.path) != Some(written.path) {
            self.log_render_path(written.path);
        }
        let pictures = (self.read_back.as_ref())
            .filter(|_| written.reads)
            .map(|buffer| self.pictures(buffer, written.size));
        Ok(Some(Released { written, pictures }))
    }

    fn log_render_path(&self, path: RenderPath) {
        let unused = match path {
            _ if self.foveation.is_none() => "",
            RenderPath::Copied => {
                "; foveation is granted, but is for what is drawn into the images"
            }
            RenderPath::Direct { foveated: false } => {
                "; foveation is granted, but is for pictures of full size"
            }
            RenderPath::Direct { foveated: true } => "",
        };
        log::info!("the eyes' pictures are {path}{unused}");
    }

    fn pictures(&self, buffer: &Buffer, size: vk::Extent2D) -> [EyePicture; 2] {
        let bytes: Vec<u8> = buffer.read(size.width as usize * size.height as usize * 8);
        let (left, right) = bytes.split_at(bytes.len() / 2);
        let blue_first = is_blue_first(self.colour.format);
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

    /// Makes what drawing into the images and copying to them needs for pictures of this target, and drops what it does not need.
    pub(crate) fn make_ready(
        &mut self,
        target: &Target,
        drawers: BackEndSet,
    ) -> Result<(), VulkanError> {
        let has_depth = target.has_depth() && self.depth.is_some();
        let draws = self.can_draw && drawers.quads;
        if (self.direct.as_ref()).is_some_and(|it| !draws || it.has_depth() != has_depth) {
            self.direct = None;
        }
        if draws && self.direct.is_none() {
            let depth = self.depth.as_ref().filter(|_| has_depth);
            match Direct::new(&self.gpu, &self.colour, depth, &self.params) {
                Ok(direct) => self.direct = Some(direct),
                Err(why @ VulkanError::OutOfMemory { .. }) => {
                    log::warn!("pictures are copied to the headset's images: {why}");
                    self.can_draw = false;
                }
                Err(error) => return Err(error),
            }
        }
        if !drawers.tiles && self.direct.is_some() {
            self.copies = None;
            return Ok(());
        }
        match &mut self.copies {
            Some(copies) => copies.bind(&self.params, target),
            none => {
                let (extent, with_depth) = (self.colour.extent, self.depth.is_some());
                let made = Copies::new(&self.gpu, extent, with_depth, &self.params, target)?;
                *none = Some(made);
            }
        }
        Ok(())
    }
}

impl Drop for EyeImages {
    fn drop(&mut self) {
        // No image is in use, except after an error.
        self.gpu.wait_idle_or_warn();
    }
}

pub(crate) fn is_blue_first(format: vk::Format) -> bool {
    matches!(
        format,
        vk::Format::B8G8R8A8_SRGB | vk::Format::B8G8R8A8_UNORM
    )
}
