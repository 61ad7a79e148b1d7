//! The whole receiver path for one frame, on one thread: deform, pack, draw.

use crate::{Deformer, Profile, ReceiverError, Stage, StageSummary, pack};
use shaders_spirv::PackedGaussian;
use spmm3::MotionParams;
use std::sync::Arc;
use xr_renderer::{BackEnd, BackEndTrial, Camera, Gpu, SplatRenderer};

/// An avatar, and the renderer that shows it.
#[derive(Debug)]
pub struct Receiver {
    deformer: Deformer,
    renderer: SplatRenderer,
    packed: Vec<PackedGaussian>,
    profile: Profile,
}

impl Receiver {
    /// Joins a loaded avatar and a renderer.
    #[must_use]
    pub fn new(deformer: Deformer, renderer: SplatRenderer) -> Self {
        let packed = vec![bytemuck::Zeroable::zeroed(); deformer.gaussians()];
        Self {
            deformer,
            renderer,
            packed,
            profile: Profile::default(),
        }
    }

    /// Deforms the avatar to `motion` and draws it once for each of `cameras` (one, or two for stereo).
    /// The pictures are then in [`Self::renderer`].
    ///
    /// # Errors
    /// If the deform graph or the renderer fails.
    pub fn frame(
        &mut self,
        motion: &MotionParams,
        cameras: &[Camera],
    ) -> Result<(), ReceiverError> {
        let gaussians = self.deformer.deform(motion, &mut self.profile)?;
        let started = std::time::Instant::now();
        pack(gaussians, &mut self.packed);
        self.profile.record(Stage::Pack, started.elapsed());
        self.renderer.set_foreground(&self.packed)?;
        self.renderer.draw(cameras)?;
        self.profile.record_picture(&self.renderer.stage_times());
        Ok(())
    }

    /// Opens the device again after [`xr_renderer::RenderError::DeviceLost`] and goes on there: avatar and background are
    /// kept on this side of the device, and the next frame is drawn as the lost one would have been. Returns the new
    /// device.
    ///
    /// # Errors
    /// If there is no such device any more, or the renderer cannot be made there.
    pub fn recover(&mut self) -> Result<Arc<Gpu>, ReceiverError> {
        Ok(self.renderer.recover()?)
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

    /// Goes on with another renderer, for pictures of another size.
    pub fn replace_renderer(&mut self, renderer: SplatRenderer) {
        self.renderer = renderer;
    }

    /// Forgets the times of the frames so far, keeping the memory: for a view that runs without end.
    pub fn forget_times(&mut self) {
        self.profile.clear();
    }

    /// Times of every frame so far, one row per stage.
    #[must_use]
    pub fn stage_times(&self) -> Vec<StageSummary> {
        self.profile.summary(self.deformer.unit())
    }
}
