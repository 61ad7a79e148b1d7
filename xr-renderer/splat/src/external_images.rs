//! Images outside the renderer that pictures are drawn into: a headset's swapchains.

use std::sync::Arc;

use ash::vk;
use renderer_vulkan::gpu::Gpu;
use shaders_spirv::FrameParams;

use crate::error::RenderError;
use crate::quad_pass::QuadPass;
use crate::target::Target;
use crate::visible_tiles::{VisibleTiles, whole_rows};

/// Which back ends may draw the pictures that follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BackEndSet {
    /// The compute back end, whose pictures are copied.
    pub tiles: bool,
    /// Rasterised quads, which can be drawn into the images.
    pub quads: bool,
}

/// Images with one layer for each view, and both paths into them: quads are rasterised into them directly where that is possible, and
/// the target's picture is copied.
pub trait ExternalImages {
    /// Prepares a picture of the target's present size by any of these back ends. The device is idle.
    ///
    /// # Errors
    /// A picture that does not fit the images, too little memory, or a device that fails.
    fn prepare(
        &mut self,
        gpu: &Arc<Gpu>,
        target: &Target,
        drawers: BackEndSet,
    ) -> Result<(), RenderError>;

    /// What anyone sees of each view of the picture that was prepared: nothing is drawn in the other tiles. All of it where there is
    /// nothing, or it is of another size.
    fn visible_tiles(&self) -> Option<&[VisibleTiles; 2]> {
        None
    }

    /// The pass whose first subpass quads are drawn in; none where the target has to be copied.
    fn pass(&self) -> Option<&Arc<QuadPass>>;

    /// Records that pass; `draw` records the first subpass over the picture's area.
    fn record_direct(&self, commands: vk::CommandBuffer, draw: &dyn Fn(vk::Rect2D));

    /// Records the copy of the target's picture, which compute or copies wrote, into the images.
    fn record_copied(&self, commands: vk::CommandBuffer);

    /// Tells that the picture is finished, and whether it was drawn directly.
    fn finished(&mut self, direct: bool);
}

/// Tells the shaders what anyone sees of the target's present picture, which these images were prepared for.
pub(crate) fn describe_visible(
    frame: &mut FrameParams,
    images: Option<&dyn ExternalImages>,
    target: &Target,
) {
    let (width, height) = (target.width, target.height);
    let all;
    let views = images
        .and_then(ExternalImages::visible_tiles)
        .filter(|views| views.iter().all(|tiles| tiles.size() == [width, height]));
    let views = match views {
        Some(views) => views,
        None => {
            all = [(); 2].map(|()| VisibleTiles::all(width, height));
            &all
        }
    };
    frame.visible_rows = VisibleTiles::rows(views);
    [frame.whole_first, frame.whole_last] = whole_rows(views);
}
