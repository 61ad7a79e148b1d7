//! From Gaussians and cameras to finished pictures. A lost device can be opened again.
//!
//! Image formation is that of 3D Gaussian Splatting (Kerbl et al., 2023): EWA projection with 0.3 px^2
//! added to the covariance's diagonal, alpha = min(0.99, opacity exp(-q/2)) cut at `ALPHA_CUT`, front to back
//! by depth. Colours are blended as display values.

use std::sync::Arc;

use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::PackedGaussian;

use crate::back_ends::BackEndTrial;
use crate::camera::Camera;
use crate::drawing::{Drawing, Foreground, Part};
use crate::engine::Engine;
use crate::error::RenderError;
use crate::external_images::ExternalImages;
use crate::limits::{MOST_PARTS, MOST_PIXELS};
use crate::lists::TileLists;
use crate::options::{BackEnd, RendererOptions};
use crate::picture::Image;
use crate::posing::{PosedInput, StateId};
use crate::slot::ForegroundSlot;
use crate::target::Target;
use crate::times::{PictureTime, StageTimes};

/// The error of every picture from then on.
const NOT_RECOVERED: RenderError =
    RenderError::Vulkan(VulkanError::DeviceLost("a recovery that failed"));

/// Draws Gaussians into one or two views, sorted once for both: a foreground that changes, and a background that
/// does not.
pub struct SplatRenderer {
    /// None after a recovery that failed.
    engine: Option<Engine>,
    gpu: Arc<Gpu>,
    options: RendererOptions,
}

impl std::fmt::Debug for SplatRenderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SplatRenderer")
            .field("gpu", &self.gpu)
            .field("max_foreground", &self.options.max_foreground)
            .field("width", &self.options.width)
            .field("height", &self.options.height)
            .field("views", &self.options.views)
            .finish_non_exhaustive()
    }
}

impl SplatRenderer {
    /// A renderer for pictures up to a size with one or two views. All memory is taken here, except that the tiles' lists
    /// grow when Gaussians are larger on the screen than a person's are, and that of foregrounds; the background is uploaded.
    ///
    /// # Errors
    /// A size out of range, or more memory than the device has.
    pub fn new(gpu: Arc<Gpu>, options: &RendererOptions) -> Result<Self, RenderError> {
        let RendererOptions {
            width,
            height,
            views,
            ..
        } = *options;
        let sizes = 1..=MOST_PIXELS;
        if !sizes.contains(&width) || !sizes.contains(&height) || !(1..=2).contains(&views) {
            return Err(RenderError::PictureSize {
                width,
                height,
                views,
            });
        }
        Ok(Self {
            engine: Some(Engine::new(&gpu, options, None)?),
            gpu,
            options: options.clone(),
        })
    }

    /// Memory for a foreground, which may be written while the device draws another: see [`Foreground::Slot`].
    ///
    /// # Errors
    /// More memory than the device has.
    pub fn foreground_slot(&self) -> Result<ForegroundSlot, RenderError> {
        self.foreground_slot_for(self.options.max_foreground)
    }

    /// Room for a foreground of at most so many Gaussians, as one part of several has.
    ///
    /// # Errors
    /// More memory than the device has.
    pub fn foreground_slot_for(&self, count: u32) -> Result<ForegroundSlot, RenderError> {
        ForegroundSlot::new(&self.gpu, count)
    }

    /// Takes another foreground (world space) for the pictures that follow, which are sorted anew; at first there is none.
    ///
    /// Gaussians with a number that is not finite are left out, as are those behind a near plane.
    ///
    /// # Errors
    /// Too many Gaussians, or a device that fails.
    pub fn set_foreground(&mut self, gaussians: &[PackedGaussian]) -> Result<(), RenderError> {
        self.engine_mut()?.set_foreground(gaussians)
    }

    /// Takes a pose of [`RendererOptions::mesh`]. The next picture that shows the mesh makes a state of it on the device,
    /// which is kept until four more poses are pushed.
    ///
    /// # Errors
    /// [`RenderError::NoMesh`] without a mesh, [`RenderError::PosedInput`] if the pose is not of its sizes, or a device that
    /// fails.
    pub fn push_state(&mut self, input: &PosedInput<'_>) -> Result<StateId, RenderError> {
        self.engine_mut()?.push_state(input)
    }

    /// Draws what [`Self::set_foreground`] took, as [`Self::draw_with`].
    ///
    /// # Errors
    /// As there.
    pub fn draw(&mut self, cameras: &[Camera]) -> Result<(), RenderError> {
        self.draw_with(&Drawing::new(cameras, &[Part::here(Foreground::Set)]))
    }

    /// Draws foreground and background as each camera sees them, and waits until they are drawn.
    ///
    /// Cameras may make smaller pictures than the renderer was made for, all of one size: nothing is allocated for that.
    /// The Gaussians are sorted anew only where the head or the foreground moved enough to change the order.
    ///
    /// # Errors
    /// Cameras, parts, a slot or states that do not fit the renderer, more splats than the tiles' lists can hold, or a device that fails.
    /// [`RenderError::CostlyPart`], before anything is blended, where the foreground covers more tiles than
    /// [`MOST_PART_PAIRS`](crate::limits::MOST_PART_PAIRS) and [`MOST_FOREGROUND_PAIRS`](crate::limits::MOST_FOREGROUND_PAIRS) allow.
    pub fn draw_with(&mut self, drawing: &Drawing<'_>) -> Result<(), RenderError> {
        self.engine_mut()?.draw(drawing, None)
    }

    /// As [`Self::draw_with`], into external images. Quads are drawn there directly and not into the renderer's own target, from
    /// which the picture then cannot be read back. Back ends are compared by the time that this takes.
    ///
    /// # Errors
    /// As there, or images of another device, another number of views or a smaller size.
    pub fn draw_onto(
        &mut self,
        drawing: &Drawing<'_>,
        images: &mut dyn ExternalImages,
    ) -> Result<(), RenderError> {
        self.engine_mut()?.draw(drawing, Some(images))
    }

    /// Opens the device again after it was lost and makes the renderer as it was, background and mesh from the host's copies.
    /// The foreground is to be set again, slots to be made and poses pushed anew. Returns the new device. What the renderer had on the
    /// lost device is freed first: if this fails the renderer draws nothing until it is tried again and succeeds. The back ends are
    /// not compared again: it is the same device.
    ///
    /// # Errors
    /// No device any more, or as [`Self::new`].
    pub fn recover(&mut self) -> Result<Arc<Gpu>, RenderError> {
        let trial = self.back_end_trial();
        // Before the device is opened, which may fail.
        self.engine = None;
        let gpu = self.gpu.reopen()?;
        self.open(gpu, trial)
    }

    /// [`Self::recover`] on a device that the caller opened, such as a headset's.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn recover_on(&mut self, gpu: Arc<Gpu>) -> Result<Arc<Gpu>, RenderError> {
        self.open(gpu, None)
    }

    fn open(
        &mut self,
        gpu: Arc<Gpu>,
        trial: Option<BackEndTrial>,
    ) -> Result<Arc<Gpu>, RenderError> {
        self.engine = None;
        self.gpu = gpu;
        self.engine = Some(Engine::new(&self.gpu, &self.options, trial)?);
        Ok(Arc::clone(&self.gpu))
    }

    /// Makes the next picture sort its Gaussians, whether they moved or not.
    pub fn forget_order(&mut self) {
        if let Some(engine) = &mut self.engine {
            engine.order.forget();
        }
    }

    /// The back end that draws the next picture.
    pub fn back_end(&self) -> BackEnd {
        let asked = self.options.back_end.unwrap_or(BackEnd::Tiles);
        self.engine
            .as_ref()
            .map_or(asked, |engine| engine.back_ends.current())
    }

    /// How the two back ends compared on the first picture; nothing before it, where one was asked for, or where the
    /// device has no clock.
    pub fn back_end_trial(&self) -> Option<BackEndTrial> {
        self.engine.as_ref()?.back_ends.trial()
    }

    /// Whether an interrupt left the comparison of the back ends unfinished: the next picture goes on with it, and takes longer.
    pub fn is_comparing(&self) -> bool {
        (self.engine.as_ref()).is_some_and(|engine| engine.back_ends.is_comparing())
    }

    /// The renderer's options.
    pub fn options(&self) -> &RendererOptions {
        &self.options
    }

    /// How long the stages of the last picture took.
    pub fn stage_times(&self) -> StageTimes {
        self.engine
            .as_ref()
            .map_or_else(StageTimes::default, |engine| engine.times)
    }

    /// When the last picture was drawn; nothing before the first.
    pub fn picture_time(&self) -> Option<PictureTime> {
        self.engine.as_ref()?.picture_time
    }

    /// (Gaussian, tile) pairs in the last picture, all views together; 0 where quads drew it.
    pub fn tile_pairs(&self) -> u32 {
        self.engine
            .as_ref()
            .map_or(0, |engine| engine.back_ends.tile_pairs())
    }

    /// (Gaussian, tile) pairs that each part of the foreground made in the last picture, all views together, whichever back end drew it; those that it would have
    /// made where it was refused for them.
    pub fn part_pairs(&self) -> [u64; MOST_PARTS] {
        self.engine
            .as_ref()
            .map_or([0; MOST_PARTS], Engine::part_pairs)
    }

    /// How many views a picture has.
    pub fn views(&self) -> u32 {
        self.options.views
    }

    /// The last picture of a view, as large as its camera said; all transparent before the first.
    ///
    /// # Errors
    /// No such view, a picture that was drawn into a headset's images alone, or a device that fails.
    pub fn read_back(&mut self, view: u32) -> Result<Image, RenderError> {
        self.check_view(view)?;
        self.engine_mut()?.read_back(view)
    }

    /// The last picture's depth in metres times its alpha, row by row from the top: divided by alpha, where that is
    /// not 0, it is the mean depth along the view's axis of what the pixel shows.
    ///
    /// # Errors
    /// A renderer that was not made to draw depth, no such view, a picture that was drawn into a headset's images alone, or a device that fails.
    pub fn read_back_depth(&mut self, view: u32) -> Result<Vec<f32>, RenderError> {
        self.check_view(view)?;
        if !self.options.depth {
            return Err(RenderError::NoDepth);
        }
        self.engine_mut()?.read_back_depth(view)
    }

    /// What the last picture was made of before it was blended, for counting work; nothing where quads drew it.
    ///
    /// # Errors
    /// A picture that was drawn into a headset's images alone, a device that fails, or more memory than the host has to give.
    pub fn read_back_lists(&mut self) -> Result<Option<TileLists>, RenderError> {
        self.engine_mut()?.read_back_lists()
    }

    /// Where the pictures lie on the device.
    pub(crate) fn target(&self) -> Result<&Target, RenderError> {
        let engine = self.engine.as_ref().ok_or(NOT_RECOVERED)?;
        Ok(&engine.target)
    }

    /// The device it draws on.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    fn engine_mut(&mut self) -> Result<&mut Engine, RenderError> {
        self.engine.as_mut().ok_or(NOT_RECOVERED)
    }

    fn check_view(&self, view: u32) -> Result<(), RenderError> {
        let views = self.views();
        if view < views {
            Ok(())
        } else {
            Err(RenderError::NoSuchView { view, views })
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::interrupt::Interrupt;
    use crate::testing::open_gpu;
    use shaders_spirv::Gaussian;

    #[test]
    fn an_interrupted_comparison_continues_picture_by_picture() {
        let Some(gpu) = open_gpu() else { return };
        let interrupt = Interrupt::default();
        let options = RendererOptions {
            interrupt: Some(interrupt.clone()),
            ..RendererOptions::new(1, 64, 64, 1)
        };
        let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
        if !(gpu.has_clock() && BackEnd::Quads.runs_on(&gpu)) {
            println!("skipped: this device has nothing to compare");
            return;
        }
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0, 64, 64);
        let ball = Gaussian {
            position: [0.0; 3],
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: [0.1; 3],
            opacity: 0.9,
            colour: [1.0; 3],
        };
        let ball = PackedGaussian::from(&ball);
        renderer.set_foreground(&[ball]).expect("one fits");
        interrupt.set(true);
        let mut pictures = 0;
        while renderer.back_end_trial().is_none() {
            assert!(pictures < 20, "no end of the comparison");
            assert_eq!(
                renderer.is_comparing(),
                pictures > 0,
                "begun with the first"
            );
            renderer.draw(&[camera]).expect("a picture");
            let seen = renderer.read_back(0).expect("a picture");
            let seen = seen.pixels().iter().any(|pixel| pixel[3] > 0.0);
            assert!(seen, "picture {pictures}");
            pictures += 1;
        }
        assert!(pictures > 4, "one picture each time: {pictures}");
        assert!(!renderer.is_comparing(), "at its end");
        assert_eq!(gpu.validation_messages(), 0, "validation messages");
    }

    #[test]
    fn a_renderer_whose_recovery_failed_holds_no_memory_says_so_and_recovers_later() {
        let Some(gpu) = open_gpu() else { return };
        let options = RendererOptions {
            back_end: Some(BackEnd::Quads),
            ..RendererOptions::new(100, 64, 64, 1)
        };
        let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
        let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0, 64, 64);
        renderer.set_foreground(&[]).expect("none fits");
        renderer.draw(&[camera]).expect("a picture");
        assert!(gpu.memory_taken() > 0, "memory in use");
        // The state that `recover` leaves where there is no device any more.
        renderer.engine = None;
        assert_eq!(gpu.memory_taken(), 0, "memory left");
        for refused in [
            renderer.set_foreground(&[]),
            renderer.draw(&[camera]),
            renderer.read_back(0).map(drop),
            renderer.target().map(drop),
        ] {
            assert!(
                matches!(&refused, Err(error) if error.is_device_lost()),
                "{refused:?}"
            );
        }
        assert_eq!(renderer.back_end(), BackEnd::Quads, "what was asked for");
        let another = renderer.recover().expect("a device");
        renderer.draw(&[camera]).expect("a picture");
        assert_eq!(another.validation_messages(), 0, "validation messages");
    }

    #[test]
    fn a_recovered_renderer_draws_with_the_back_end_that_was_found_faster() {
        let Some(gpu) = open_gpu() else { return };
        let options = RendererOptions::new(1, 64, 64, 1);
        // Found on the device that will be lost, by a margin that no trial of one ball would find.
        for (tiles, quads) in [(1.0, 100.0), (100.0, 1.0)] {
            let found = BackEndTrial { tiles, quads };
            if !found.winner().runs_on(&gpu) {
                continue;
            }
            let mut renderer = SplatRenderer::new(Arc::clone(&gpu), &options).expect("a renderer");
            renderer.open(Arc::clone(&gpu), Some(found)).expect("kept");
            let another = renderer.recover().expect("a device");
            let camera = Camera::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0, 64, 64);
            renderer.set_foreground(&[]).expect("none fits");
            renderer.draw(&[camera]).expect("a picture");
            assert_eq!(renderer.back_end(), found.winner());
            assert_eq!(renderer.back_end_trial(), Some(found), "not compared again");
            assert_eq!(another.validation_messages(), 0, "validation messages");
        }
    }
}
