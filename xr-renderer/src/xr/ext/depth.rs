//! `XR_KHR_composition_layer_depth`: the pictures' depth, with which a compositor moves them on to the moment of display.
//!
//! Without it the layers go without depth, and the compositor turns them only.

use std::marker::PhantomData;

use openxr::{
    CompositionLayerProjectionView, Instance, SwapchainSubImage, Vulkan,
    sys::{CompositionLayerDepthInfoKHR, StructureType},
};

use super::Absent;

/// That the runtime takes depth, and what the depth image's numbers mean: 0 at `near`, 1 at `far`, as a perspective
/// projection with Vulkan's depth range writes them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthRange {
    near_metres: f32,
    far_metres: f32,
}

impl DepthRange {
    /// Depth between two distances from the eye's plane, along its view axis.
    ///
    /// # Errors
    /// [`Absent`] where the runtime takes none.
    ///
    /// # Panics
    /// Unless 0 < near < far; far may be infinite.
    pub fn new(instance: &Instance, near_metres: f32, far_metres: f32) -> Result<Self, Absent> {
        assert!(
            0.0 < near_metres && near_metres < far_metres,
            "depth goes from near to far"
        );
        if instance.exts().khr_composition_layer_depth.is_none() {
            return Err(Absent::NotGranted("XR_KHR_composition_layer_depth"));
        }
        Ok(Self {
            near_metres,
            far_metres,
        })
    }

    /// One eye's depth, to be chained to its view. It must have the colour image's rectangle and layer.
    #[must_use]
    pub fn image<'a>(&self, sub_image: SwapchainSubImage<'a, Vulkan>) -> DepthImage<'a> {
        DepthImage {
            info: CompositionLayerDepthInfoKHR {
                ty: CompositionLayerDepthInfoKHR::TYPE,
                next: std::ptr::null(),
                sub_image: sub_image.into_raw(),
                min_depth: 0.0,
                max_depth: 1.0,
                near_z: self.near_metres,
                far_z: self.far_metres,
            },
            swapchain: PhantomData,
        }
    }
}

/// One eye's depth image.
#[derive(Debug)]
pub struct DepthImage<'a> {
    info: CompositionLayerDepthInfoKHR,
    swapchain: PhantomData<&'a ()>,
}

impl<'a> DepthImage<'a> {
    /// The view, with this depth.
    #[must_use]
    pub fn of<'b>(
        &'b self,
        view: CompositionLayerProjectionView<'b, Vulkan>,
    ) -> CompositionLayerProjectionView<'b, Vulkan>
    where
        'a: 'b,
    {
        let mut raw = view.into_raw();
        debug_assert_eq!(
            raw.ty,
            StructureType::COMPOSITION_LAYER_PROJECTION_VIEW,
            "a view"
        );
        raw.next = std::ptr::from_ref(&self.info).cast();
        // SAFETY: what the view points to was alive for 'b, and so is the depth, which is now part of it.
        unsafe { CompositionLayerProjectionView::from_raw(raw) }
    }
}
