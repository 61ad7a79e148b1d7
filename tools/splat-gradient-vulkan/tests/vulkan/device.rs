//! What these tests draw with, those that they share with `splat-gradient` included.

use renderer_vulkan::gpu::Gpu;
use splat_gradient::device::Derivable;
use splat_gradient::error::GradientError;
use splat_gradient::{Attributes, SplatDevice, View};
use splat_gradient_vulkan::VulkanSplatter;
use std::sync::Arc;
use test_support::vulkan::{assert_silent, gpu};

/// A splatter that demands, when it is dropped, that the validation layer had nothing to say of it.
#[derive(Debug)]
pub(crate) struct Watched {
    /// There until it is dropped.
    splatter: Option<VulkanSplatter>,
    gpu: Arc<Gpu>,
}

impl Watched {
    pub(crate) fn new(gpu: &Arc<Gpu>) -> Self {
        let splatter = VulkanSplatter::new(gpu).expect("a device that does not fail");
        Self {
            splatter: Some(splatter),
            gpu: Arc::clone(gpu),
        }
    }
}

impl SplatDevice for Watched {
    fn draw<'a>(
        &'a mut self,
        gaussians: &'a Attributes,
        view: &View,
    ) -> Result<Box<dyn Derivable + 'a>, GradientError> {
        let splatter = self.splatter.as_mut().expect("it is there until the end");
        splatter.draw(gaussians, view)
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        // First what it made, of whose end the layer may have something to say as well.
        drop(self.splatter.take());
        if !std::thread::panicking() {
            assert_silent(&self.gpu);
        }
    }
}

/// A splatter on the device that `MON3TR_GPU` names; nothing, after a line that says so, where there is no Vulkan. On CI that is a failure.
pub(crate) fn device() -> Option<Box<dyn SplatDevice>> {
    Some(Box::new(Watched::new(&gpu()?)))
}
