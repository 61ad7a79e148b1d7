//! What these tests draw with. `splat-gradient-vulkan` has the same tests with a device of its own.

use splat_gradient::{SplatDevice, Splatter};

/// The CPU's splatter, which is never missing.
pub(crate) fn device() -> Option<Box<dyn SplatDevice>> {
    Some(Box::new(Splatter::new()))
}
