//! What these tests draw with, those that they share with `splat-gradient` included.

use splat_gradient::SplatDevice;
use splat_gradient_vulkan::VulkanSplatter;
use test_support::vulkan::gpu;

/// A splatter on the device that `MON3TR_GPU` names; nothing, after a line that says so, where there is no Vulkan. On CI that is a failure.
pub(crate) fn device() -> Option<Box<dyn SplatDevice>> {
    let splatter = VulkanSplatter::new(&gpu()?).expect("a device that does not fail");
    Some(Box::new(splatter))
}
