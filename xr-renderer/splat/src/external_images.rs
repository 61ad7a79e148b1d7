//! Where a picture goes as soon as it is drawn, if not to the renderer's own target alone: images of somebody else's.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::gpu::Gpu;

use crate::error::RenderError;
use crate::quad_pass::QuadPass;
use crate::target::Target;

/// Which back ends may draw the pictures that follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Drawers {
    /// The compute back end, whose pictures are copied.
    pub tiles: bool,
    /// Rasterised quads, which can be drawn into the images.
    pub quads: bool,
}

/// Images of a layer for each view, and both ways into them: quads are drawn into them, where they can be drawn into, and what
/// lies in the target is copied.
pub trait ExternalImages {
    /// Makes everything ready for a picture of the target's present size by any of these back ends. The device is idle.
    fn prepare(
        &mut self,
        gpu: &Arc<Gpu>,
        target: &Target,
        drawers: Drawers,
    ) -> Result<(), RenderError>;

    /// The pass whose first part quads are drawn in; nothing where the target has to be copied.
    fn pass(&self) -> Option<&Arc<QuadPass>>;

    /// Records that pass, with what `draw` records in its first part over the picture's area.
    fn record_direct(&self, commands: vk::CommandBuffer, draw: &dyn Fn(vk::Rect2D));

    /// Records the way of the target's picture, which compute or copies wrote, into the images.
    fn record_copied(&self, commands: vk::CommandBuffer);

    /// The picture is there, by the one way or the other.
    fn drawn(&mut self, directly: bool);
}
