//! What a frame is made of for the compositor: the room behind, both eyes' pictures, a panel.

use openxr::sys;
use openxr::{EnvironmentBlendMode, Instance, Session, Space, Time, View, Vulkan};

use super::error::{XrContext, XrError};
use super::eyes::{EyeImages, FAR, NEAR};
use super::panel::Panel;
use super::space::pose;
use glam::Affine3A;

/// The layers of one frame, from back to front.
pub(crate) struct Layers<'a> {
    pub(crate) passthrough: Option<sys::CompositionLayerPassthroughFB>,
    pub(crate) eyes: Option<(&'a EyeImages, &'a [View; 2])>,
    pub(crate) panel: Option<(&'a Panel, PlacedPanel)>,
    /// Where eyes and panel are.
    pub(crate) floor: &'a Space,
    /// Whether the eyes' alpha counts.
    pub(crate) transparent: bool,
}

/// Where a panel hangs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlacedPanel {
    pub(crate) floor_from_panel: Affine3A,
    /// Width in metres; its height follows from its pixels.
    pub(crate) width: f32,
}

impl Layers<'_> {
    /// Ends the frame that is to be seen at `time` with these layers.
    pub(crate) fn end_frame(
        &self,
        instance: &Instance,
        session: &Session<Vulkan>,
        time: Time,
        blend: EnvironmentBlendMode,
    ) -> Result<(), XrError> {
        let depths = self.eyes.and_then(|(images, _)| depth_infos(images));
        let views = self.eyes.map(|(images, views)| {
            let mut projected = [0, 1].map(|eye| view_of(images, views, eye));
            if let Some(depths) = &depths {
                for (view, depth) in projected.iter_mut().zip(depths) {
                    view.next = std::ptr::from_ref(depth).cast();
                }
            }
            projected
        });
        let mut flags = sys::CompositionLayerFlags::EMPTY;
        if self.transparent {
            flags |= sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA;
        }
        let projection = views.as_ref().map(|views| sys::CompositionLayerProjection {
            ty: sys::CompositionLayerProjection::TYPE,
            next: std::ptr::null(),
            layer_flags: flags,
            space: self.floor.as_raw(),
            view_count: 2,
            views: views.as_ptr(),
        });
        let panel = self.panel.map(|(panel, placed)| self.quad(panel, placed));
        let mut layers: [*const sys::CompositionLayerBaseHeader; 3] = [std::ptr::null(); 3];
        let there = [
            self.passthrough
                .as_ref()
                .map(|layer| std::ptr::from_ref(layer).cast()),
            projection
                .as_ref()
                .map(|layer| std::ptr::from_ref(layer).cast()),
            panel.as_ref().map(|layer| std::ptr::from_ref(layer).cast()),
        ];
        let mut count = 0;
        for (place, layer) in layers.iter_mut().zip(there.into_iter().flatten()) {
            *place = layer;
            count += 1;
        }
        let info = sys::FrameEndInfo {
            ty: sys::FrameEndInfo::TYPE,
            next: std::ptr::null(),
            display_time: time,
            environment_blend_mode: blend,
            layer_count: count,
            layers: layers.as_ptr(),
        };
        // SAFETY: all structures, and those they point to, live until the call returns; swapchains and spaces are the session's.
        let result = unsafe { (instance.fp().end_frame)(session.as_raw(), &raw const info) };
        if result.into_raw() < 0 {
            return Err(result).during("xrEndFrame");
        }
        Ok(())
    }

    fn quad(&self, panel: &Panel, placed: PlacedPanel) -> sys::CompositionLayerQuad {
        let extent = panel.images.extent;
        sys::CompositionLayerQuad {
            ty: sys::CompositionLayerQuad::TYPE,
            next: std::ptr::null(),
            layer_flags: sys::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
            space: self.floor.as_raw(),
            eye_visibility: openxr::EyeVisibility::BOTH,
            sub_image: sys::SwapchainSubImage {
                swapchain: panel.images.handle.as_raw(),
                image_rect: rect(extent.width, extent.height),
                image_array_index: 0,
            },
            pose: pose(placed.floor_from_panel),
            size: openxr::Extent2Df {
                width: placed.width,
                height: placed.width * extent.height as f32 / extent.width.max(1) as f32,
            },
        }
    }
}

fn view_of(images: &EyeImages, views: &[View; 2], eye: u32) -> sys::CompositionLayerProjectionView {
    let (size, _) = images.written();
    let [left, right] = *views;
    let view = if eye == 0 { left } else { right };
    sys::CompositionLayerProjectionView {
        ty: sys::CompositionLayerProjectionView::TYPE,
        next: std::ptr::null(),
        pose: view.pose,
        fov: view.fov,
        sub_image: sys::SwapchainSubImage {
            swapchain: images.colour.handle.as_raw(),
            image_rect: rect(size.width, size.height),
            image_array_index: eye,
        },
    }
}

/// Both eyes' depth (`XR_KHR_composition_layer_depth`), where the last picture has it.
fn depth_infos(images: &EyeImages) -> Option<[sys::CompositionLayerDepthInfoKHR; 2]> {
    let (size, true) = images.written() else {
        return None;
    };
    let depth = images.depth.as_ref()?;
    Some([0, 1].map(|eye| sys::CompositionLayerDepthInfoKHR {
        ty: sys::CompositionLayerDepthInfoKHR::TYPE,
        next: std::ptr::null(),
        sub_image: sys::SwapchainSubImage {
            swapchain: depth.handle.as_raw(),
            image_rect: rect(size.width, size.height),
            image_array_index: eye,
        },
        min_depth: 0.0,
        max_depth: 1.0,
        near_z: NEAR,
        far_z: FAR,
    }))
}

fn rect(width: u32, height: u32) -> openxr::Rect2Di {
    let side = |pixels: u32| i32::try_from(pixels).unwrap_or(i32::MAX);
    openxr::Rect2Di {
        offset: openxr::Offset2Di { x: 0, y: 0 },
        extent: openxr::Extent2Di {
            width: side(width),
            height: side(height),
        },
    }
}
