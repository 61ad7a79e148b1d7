//! What a scan looks like from a [`Pinhole`]: drawn by the renderer that draws avatars, on a GPU or without one.

use crate::RigError;
use crate::pinhole::Pinhole;
use crate::scan::Scan;
use rayon::prelude::*;
use renderer_splat::gaussian::PackedGaussian;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::{Backdrop, Image};
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::gpu::Gpu;
use std::sync::Arc;
use tracker::TrackerError;
use tracker::picture::PictureView;

/// The least room for Gaussians that a renderer is made with: scans differ, and a renderer that has to be made again compiles its
/// shaders again.
const LEAST_ROOM: usize = 1 << 18;
/// The least side of pictures that a renderer is made for, pixels.
const LEAST_SIDE: u32 = 1024;

/// A picture of display values in 8 bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rgb {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Red, green, blue, row by row from the top.
    pub bytes: Vec<u8>,
}

impl Rgb {
    /// As networks see it.
    ///
    /// # Errors
    /// If the bytes are not as many as the size says.
    pub fn view(&self) -> Result<PictureView<'_>, TrackerError> {
        PictureView::new(self.width as usize, self.height as usize, &self.bytes)
    }
}

/// Draws one scan after another. One device and, as long as scans and pictures fit, one renderer: its shaders are compiled once.
pub struct Sight {
    gpu: Arc<Gpu>,
    renderer: Option<SplatRenderer>,
    packed: Vec<PackedGaussian>,
    /// Whether the renderer lacks `packed`.
    stale: bool,
}

impl std::fmt::Debug for Sight {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Sight")
            .field("gpu", &self.gpu)
            .field("gaussians", &self.packed.len())
            .finish_non_exhaustive()
    }
}

impl Sight {
    /// Opens the chosen device. Nothing is to be seen yet.
    ///
    /// # Errors
    /// [`RigError::Draw`] if there is no such device, or it lacks what the shaders need.
    pub fn open(choice: &GpuChoice) -> Result<Self, RigError> {
        Ok(Self::on(Gpu::open(choice, false)?))
    }

    /// The same on a device that is open.
    #[must_use]
    pub fn on(gpu: Arc<Gpu>) -> Self {
        Self {
            gpu,
            renderer: None,
            packed: Vec::new(),
            stale: false,
        }
    }

    /// The device.
    #[must_use]
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Shows another scan from now on. Gaussians with a number that is not finite are not drawn.
    pub fn set(&mut self, scan: &Scan) {
        (0..scan.len())
            .into_par_iter()
            .map(|at| {
                PackedGaussian::new(
                    scan.positions[at].to_array(),
                    scan.rotations[at].to_array(),
                    scan.scales[at].to_array().map(f32::log2),
                    scan.opacities[at],
                    scan.colours[at].to_array(),
                )
            })
            .collect_into_vec(&mut self.packed);
        self.stale = true;
    }

    /// The scan from a view, over nothing: display values, premultiplied alpha. The same view of the same scan is the same picture.
    ///
    /// # Errors
    /// [`RigError::Draw`] if the scan or the picture is too large for the device, or the device fails.
    pub fn draw(&mut self, view: &Pinhole) -> Result<Image, RigError> {
        let renderer = self.ready(view)?;
        // The order of a nearby view would serve, but the picture would depend on what was drawn before.
        renderer.forget_order();
        renderer.draw(&[view.camera()])?;
        Ok(renderer.read_back(0)?)
    }

    /// The scan from a view, over a plain colour (display values, 0..=1).
    ///
    /// # Errors
    /// As [`Self::draw`].
    pub fn picture(&mut self, view: &Pinhole, behind: [f32; 3]) -> Result<Rgb, RigError> {
        let image = self.draw(view)?;
        Ok(Rgb {
            width: image.width(),
            height: image.height(),
            bytes: image.over(Backdrop::Colour(behind)),
        })
    }

    /// A renderer with room for the scan and the picture, which has the scan.
    fn ready(&mut self, view: &Pinhole) -> Result<&mut SplatRenderer, RigError> {
        let fits = |options: &RendererOptions| {
            options.max_foreground as usize >= self.packed.len()
                && options.width >= view.width
                && options.height >= view.height
        };
        let old = (self.renderer.take()).filter(|renderer| fits(renderer.options()));
        let renderer = match old {
            Some(renderer) => self.renderer.insert(renderer),
            None => {
                let room = self.packed.len().next_power_of_two().max(LEAST_ROOM);
                let options = RendererOptions {
                    // Not whichever is faster: pictures would differ from run to run.
                    back_end: Some(BackEnd::Tiles),
                    ..RendererOptions::new(
                        u32::try_from(room).unwrap_or(u32::MAX),
                        view.width.max(LEAST_SIDE),
                        view.height.max(LEAST_SIDE),
                        1,
                    )
                };
                self.stale = true;
                self.renderer
                    .insert(SplatRenderer::new(Arc::clone(&self.gpu), &options)?)
            }
        };
        if self.stale {
            renderer.set_foreground(&self.packed)?;
            self.stale = false;
        }
        Ok(renderer)
    }
}
