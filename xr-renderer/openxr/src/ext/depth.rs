//! `XR_KHR_composition_layer_depth`: the pictures' depth, with which a compositor reprojects them to the display time.
//!
//! Without it the layers have no depth, and the compositor reprojects by rotation only.

use std::marker::PhantomData;

use openxr::{
    CompositionLayerProjectionView, Instance, SwapchainSubImage, Vulkan,
    sys::{CompositionLayerDepthInfoKHR, StructureType},
};

use super::Absent;

/// The runtime takes depth. The depth image has 0 at `near`, 1 at `far`, as a perspective
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::FakeRuntime;
    use openxr::{
        CompositionLayerProjection, EnvironmentBlendMode, Posef, ReferenceSpaceType,
        SwapchainCreateFlags, SwapchainCreateInfo, SwapchainUsageFlags, ViewConfigurationType,
    };

    #[test]
    fn each_eyes_view_goes_to_the_compositor_with_its_own_depth() {
        let fake = FakeRuntime::with_everything();
        let instance = fake.instance();
        let (session, mut waiter, mut stream) = fake.session(&instance);
        let space = session
            .create_reference_space(ReferenceSpaceType::LOCAL_FLOOR, Posef::IDENTITY)
            .expect("a space");
        let images = session
            .create_swapchain(&SwapchainCreateInfo {
                create_flags: SwapchainCreateFlags::EMPTY,
                usage_flags: SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT,
                format: 126,
                sample_count: 1,
                width: 64,
                height: 64,
                face_count: 1,
                array_size: 2,
                mip_count: 1,
            })
            .expect("images");
        session
            .begin(ViewConfigurationType::PRIMARY_STEREO)
            .expect("begun");
        let frame = waiter.wait().expect("waited");
        stream.begin().expect("begun");
        let range = DepthRange::new(&instance, 0.05, f32::INFINITY).expect("depth");
        let part = |eye| {
            SwapchainSubImage::new()
                .swapchain(&images)
                .image_array_index(eye)
        };
        let depths = [0, 1].map(|eye| range.image(part(eye)));
        let views = [0, 1].map(|eye| {
            let view = CompositionLayerProjectionView::new().sub_image(part(eye));
            depths[eye as usize].of(view)
        });
        let layer = CompositionLayerProjection::new()
            .space(&space)
            .views(&views);
        let time = frame.predicted_display_time;
        stream
            .end(time, EnvironmentBlendMode::OPAQUE, &[&layer])
            .expect("ended");
        let layers = fake.set(|world| world.frames[0].layers.clone());
        for eye in [0, 1] {
            let expected = format!(
                "; layer {eye} + COMPOSITION_LAYER_DEPTH_INFO_KHR(layer {eye}, 0.05..inf m)"
            );
            assert!(layers[0].contains(&expected), "{layers:?}");
        }
    }

    #[test]
    fn a_runtime_that_takes_no_depth_gets_none() {
        let fake = FakeRuntime::with_everything();
        fake.set(|world| {
            world
                .extensions
                .retain(|name| *name != "XR_KHR_composition_layer_depth");
        });
        let why = DepthRange::new(&fake.instance(), 0.05, 50.0).expect_err("no depth");
        assert!(why.to_string().contains("composition_layer_depth"), "{why}");
    }
}
