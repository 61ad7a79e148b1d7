//! Devices that come and go under a call: what was on the last one is made anew on the next, and all people stay.

use super::people::check_room;
use super::{Drawn, Lanes, MotionSource};
use crate::error::ReceiverError;
use renderer_splat::error::RenderError;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::gpu::Gpu;
use std::sync::Arc;

impl<S: MotionSource> Lanes<S> {
    /// Goes on with the same people on another device: the one that a headset's runtime made after [`Drawn::Lost`], or at any
    /// other time. If this fails nothing can be drawn until it is tried again and succeeds.
    ///
    /// # Errors
    /// If the device cannot take the renderer or the Gaussians there are.
    pub fn move_to(&mut self, gpu: Arc<Gpu>) -> Result<(), ReceiverError> {
        self.is_lost = true;
        self.renderer.recover_on(gpu)?;
        self.renew()?;
        self.is_lost = false;
        Ok(())
    }

    /// The device was lost in a picture: opens it again if that can be done from here.
    pub(super) fn lose(&mut self, error: &RenderError) -> Result<Drawn, ReceiverError> {
        self.drawing = None;
        if self.renderer.gpu().belongs_to_headset() {
            log::warn!("{error}; the call goes on and waits for the headset's next device");
            self.is_lost = true;
            return Ok(Drawn::Lost);
        }
        log::warn!("{error}; going on with the device opened again");
        let gpu = self.renderer.recover()?;
        self.renew()?;
        Ok(Drawn::Renewed(gpu))
    }

    /// Makes all that is kept on a device on the renderer's present one.
    fn renew(&mut self) -> Result<(), ReceiverError> {
        self.drawing = None;
        for person in self.people.iter_mut() {
            person.renew(&mut self.renderer)?;
        }
        Ok(self.scenery.renew(&self.renderer)?)
    }

    /// Goes on with another renderer, for pictures of another kind, on the same device or another.
    ///
    /// # Errors
    /// If it cannot take the Gaussians there are.
    pub fn replace_renderer(&mut self, renderer: SplatRenderer) -> Result<(), ReceiverError> {
        check_room(&renderer, self.room_taken())?;
        let is_elsewhere = !Arc::ptr_eq(renderer.gpu(), self.renderer.gpu());
        self.renderer = renderer;
        if is_elsewhere {
            self.is_lost = true;
            self.renew()?;
            self.is_lost = false;
            return Ok(());
        }
        for person in self.people.iter_mut() {
            person.adopt(&mut self.renderer)?;
        }
        Ok(())
    }
}
