//! The whole receiver path for one frame, on one thread: deform, pack, draw.

use crate::deform::Deformer;
use crate::error::ReceiverError;
use crate::profile::{Profile, StageSummary};
use crate::stage::Stage;
use app_kernels::Blend;
use renderer_splat::back_ends::BackEndTrial;
use renderer_splat::camera::Camera;
use renderer_splat::drawing::{Drawing, Foreground, Part};
use renderer_splat::motion_bound::MotionBound;
use renderer_splat::options::BackEnd;
use renderer_splat::renderer::SplatRenderer;
use renderer_splat::slot::ForegroundSlot;
use renderer_vulkan::gpu::Gpu;
use spmm3::MotionParams;
use std::sync::Arc;

/// An avatar, and the renderer that shows it.
#[derive(Debug)]
pub struct Receiver {
    deformer: Deformer,
    renderer: SplatRenderer,
    slot: ForegroundSlot,
    profile: Profile,
}

impl Receiver {
    /// Joins a loaded avatar and a renderer.
    ///
    /// # Errors
    /// If the device has no memory for the avatar's Gaussians.
    pub fn new(deformer: Deformer, renderer: SplatRenderer) -> Result<Self, ReceiverError> {
        Ok(Self {
            deformer,
            slot: renderer.foreground_slot()?,
            renderer,
            profile: Profile::default(),
        })
    }

    /// Deforms the avatar to `motion` and draws it once for each of `cameras` (one, or two for stereo).
    /// The pictures are then in [`Self::renderer`].
    ///
    /// # Errors
    /// If the deform graph or the renderer fails, or the renderer was made for fewer Gaussians.
    pub fn frame(
        &mut self,
        motion: &MotionParams,
        cameras: &[Camera],
    ) -> Result<(), ReceiverError> {
        let state = self.deformer.deform(motion, &mut self.profile)?;
        let started = std::time::Instant::now();
        let all = 0..state.len();
        let gaussians = self.slot.gaussians_mut();
        let gaussians = gaussians.get_mut(all.clone()).unwrap_or_default();
        Blend::new(state, state, 1.0)?.pack(all, gaussians)?;
        self.profile.record(Stage::Interpolate, started.elapsed());
        let count = u32::try_from(state.len()).unwrap_or(u32::MAX);
        // Nothing is known of how far they went.
        self.slot.set(count, MotionBound::new())?;
        let foreground = Foreground::Slot(&self.slot);
        self.renderer
            .draw_with(&Drawing::new(cameras, &[Part::here(foreground)]))?;
        self.profile.record_picture(&self.renderer.stage_times());
        Ok(())
    }

    /// Opens the device again after [an error that is a device's loss](renderer_splat::error::RenderError::is_device_lost) and goes on there: avatar and background are
    /// kept on this side of the device, and the next frame is drawn as the lost one would have been. Returns the new
    /// device.
    ///
    /// # Errors
    /// If there is no such device any more, or the renderer cannot be made there.
    pub fn recover(&mut self) -> Result<Arc<Gpu>, ReceiverError> {
        let gpu = self.renderer.recover()?;
        self.slot = self.renderer.foreground_slot()?;
        Ok(gpu)
    }

    /// What draws the next picture.
    #[must_use]
    pub fn back_end(&self) -> BackEnd {
        self.renderer.back_end()
    }

    /// How the renderer's two back ends compared on the first picture, if they did.
    #[must_use]
    pub fn back_end_trial(&self) -> Option<BackEndTrial> {
        self.renderer.back_end_trial()
    }

    /// The avatar's side.
    #[must_use]
    pub fn deformer(&self) -> &Deformer {
        &self.deformer
    }

    /// The renderer's side, which holds the last pictures.
    pub fn renderer(&mut self) -> &mut SplatRenderer {
        &mut self.renderer
    }

    /// Times of every frame so far, one row per stage.
    #[must_use]
    pub fn stage_times(&self) -> Vec<StageSummary> {
        self.profile.summary(|stage| self.deformer.unit(stage))
    }
}
