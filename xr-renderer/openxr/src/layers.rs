//! A frame's composition layers, from back to front: the room, both eyes' pictures, a panel.

use glam::Affine3A;
use openxr::{
    CompositionLayerBase, CompositionLayerFlags, CompositionLayerProjection,
    CompositionLayerProjectionView, CompositionLayerQuad, EnvironmentBlendMode, EyeVisibility,
    FrameStream, Space, SwapchainSubImage, Time, View, Vulkan,
};

use crate::error::{XrContext, XrError};
use crate::ext::depth::DepthRange;
use crate::ext::passthrough::PassthroughLayer;
use crate::eyes::{EyeImages, Written};
use crate::panel::Panel;
use crate::pose::posef;
use crate::swapchain::Swapchain;

/// The layers of one frame.
pub(crate) struct FrameLayers<'a> {
    pub(crate) room: Option<PassthroughLayer<'a>>,
    pub(crate) eyes: Option<(&'a EyeImages, &'a Written)>,
    /// What depths mean, where the compositor takes them.
    pub(crate) depth: Option<DepthRange>,
    pub(crate) panel: Option<(&'a Panel, PlacedPanel)>,
    /// Where eyes and panel are.
    pub(crate) floor: &'a Space,
    /// Whether the eyes' pictures are blended by alpha.
    pub(crate) transparent: bool,
}

/// Where a panel hangs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlacedPanel {
    pub(crate) floor_from_panel: Affine3A,
    /// Width in metres; its height follows from its pixels.
    pub(crate) width: f32,
}

impl FrameLayers<'_> {
    /// Ends the frame that is displayed at `time` with these layers.
    pub(crate) fn end_frame(
        &self,
        stream: &mut FrameStream<Vulkan>,
        time: Time,
        blend: EnvironmentBlendMode,
    ) -> Result<(), XrError> {
        let depths = self.depths();
        let views = self.eyes.map(|(images, written)| {
            let [left, right] = &written.views;
            let view = |eye: u32, view: &View| {
                let picture = CompositionLayerProjectionView::new()
                    .pose(view.pose)
                    .fov(view.fov)
                    .sub_image(part(&images.colour, written.size, eye));
                match depths
                    .as_ref()
                    .map(|[left, right]| if eye == 0 { left } else { right })
                {
                    Some(depth) => depth.of(picture),
                    None => picture,
                }
            };
            [view(0, left), view(1, right)]
        });
        let flags = if self.transparent {
            CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA
        } else {
            CompositionLayerFlags::EMPTY
        };
        let pictures = views.as_ref().map(|views| {
            CompositionLayerProjection::new()
                .layer_flags(flags)
                .space(self.floor)
                .views(views)
        });
        let panel = self.panel.map(|(panel, placed)| {
            let extent = panel.images.extent;
            CompositionLayerQuad::new()
                .layer_flags(CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA)
                .space(self.floor)
                .eye_visibility(EyeVisibility::BOTH)
                .sub_image(part(&panel.images, extent, 0))
                .pose(posef(&placed.floor_from_panel))
                .size(openxr::Extent2Df {
                    width: placed.width,
                    height: placed.width * extent.height as f32 / extent.width.max(1) as f32,
                })
        });
        let mut layers: Vec<&CompositionLayerBase<'_, Vulkan>> = Vec::with_capacity(3);
        layers.extend(self.room.as_deref());
        layers.extend(pictures.as_deref());
        layers.extend(panel.as_deref());
        stream.end(time, blend, &layers).during("xrEndFrame")
    }

    /// Both eyes' depth, where the last picture has it.
    fn depths(&self) -> Option<[crate::ext::depth::DepthImage<'_>; 2]> {
        let (images, written) = self.eyes.filter(|(_, written)| written.has_depth)?;
        let (range, depth) = (self.depth?, images.depth.as_ref()?);
        Some([0, 1].map(|eye| range.image(part(depth, written.size, eye))))
    }
}

/// The upper left of an image's layer.
fn part(images: &Swapchain, size: ash::vk::Extent2D, layer: u32) -> SwapchainSubImage<'_, Vulkan> {
    let side = |pixels: u32| i32::try_from(pixels).unwrap_or(i32::MAX);
    SwapchainSubImage::new()
        .swapchain(&images.handle)
        .image_array_index(layer)
        .image_rect(openxr::Rect2Di {
            offset: openxr::Offset2Di { x: 0, y: 0 },
            extent: openxr::Extent2Di {
                width: side(size.width),
                height: side(size.height),
            },
        })
}
