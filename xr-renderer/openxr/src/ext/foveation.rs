//! `XR_FB_foveation` with `_configuration` and `_vulkan`: swapchains whose images are drawn coarser away from the centre of view,
//! around the gaze with `XR_META_foveation_eye_tracked`.
//!
//! Without them swapchains are plain. Raw calls, because `openxr` 0.22 chains no structure to `XrSwapchainCreateInfo`.

use ash::vk::{self, Handle as _};
use glam::Vec2;
use openxr::sys::{self, Handle as _};
use openxr::{Graphics, Session, Swapchain, SwapchainCreateInfo, SystemId, Vulkan};

use super::{Absent, ask_system, outcome, refused};
use crate::error::{XrContext, XrError};

/// How images are drawn coarser towards their edge: at most by half, less where the GPU has time to spare.
pub struct Foveation {
    session: Session<Vulkan>,
    profile: sys::FoveationProfileFB,
    follows_gaze: bool,
}

impl std::fmt::Debug for Foveation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Foveation")
            .field("follows_gaze", &self.follows_gaze)
            .finish_non_exhaustive()
    }
}

/// One swapchain image's density map: an `R8G8_UNORM` image, for a render pass that draws into that image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DensityMap {
    /// The image, the runtime's own.
    pub image: vk::Image,
    /// Its width, texels.
    pub width: u32,
    /// Its height, texels.
    pub height: u32,
}

impl Foveation {
    /// Makes a profile of medium level that the runtime may lower, around the gaze where that is tracked.
    /// `density_maps` tells whether the device was made with `VK_EXT_fragment_density_map`.
    ///
    /// # Errors
    /// [`Absent`] where runtime or device lacks something, or the runtime refuses it.
    pub fn new(
        session: &Session<Vulkan>,
        system: SystemId,
        density_maps: bool,
    ) -> Result<Self, Absent> {
        let exts = session.instance().exts();
        let fp = exts
            .fb_foveation
            .as_ref()
            .ok_or(Absent::NotGranted("XR_FB_foveation"))?;
        for (there, name) in [
            (
                exts.fb_foveation_configuration.is_some(),
                "XR_FB_foveation_configuration",
            ),
            (exts.fb_foveation_vulkan.is_some(), "XR_FB_foveation_vulkan"),
            (
                exts.fb_swapchain_update_state.is_some(),
                "XR_FB_swapchain_update_state",
            ),
        ] {
            if !there {
                return Err(Absent::NotGranted(name));
            }
        }
        if !density_maps {
            return Err(Absent::NotByDevice("VK_EXT_fragment_density_map"));
        }
        let follows_gaze = tracks_gaze(session, system);
        let mut around_gaze = sys::FoveationEyeTrackedProfileCreateInfoMETA {
            ty: sys::FoveationEyeTrackedProfileCreateInfoMETA::TYPE,
            next: std::ptr::null(),
            flags: sys::FoveationEyeTrackedProfileCreateFlagsMETA::EMPTY,
        };
        let mut level = sys::FoveationLevelProfileCreateInfoFB {
            ty: sys::FoveationLevelProfileCreateInfoFB::TYPE,
            next: std::ptr::null_mut(),
            level: sys::FoveationLevelFB::MEDIUM,
            vertical_offset: 0.0,
            dynamic: sys::FoveationDynamicFB::LEVEL_ENABLED,
        };
        if follows_gaze {
            level.next = std::ptr::from_mut(&mut around_gaze).cast();
        }
        let info = sys::FoveationProfileCreateInfoFB {
            ty: sys::FoveationProfileCreateInfoFB::TYPE,
            next: std::ptr::from_mut(&mut level).cast(),
        };
        let mut profile = sys::FoveationProfileFB::NULL;
        // SAFETY: the session is alive; the chain lives on this stack until the call is over.
        let result =
            unsafe { (fp.create_foveation_profile)(session.as_raw(), &info, &mut profile) };
        outcome(result).map_err(refused("xrCreateFoveationProfileFB"))?;
        Ok(Self {
            session: session.clone(),
            profile,
            follows_gaze,
        })
    }

    /// Whether the finest part follows the wearer's gaze instead of staying in the middle.
    #[must_use]
    pub fn follows_gaze(&self) -> bool {
        self.follows_gaze
    }

    /// Has the runtime put the finest part of a swapchain's next image where the wearer looks, and returns where that is in each
    /// eye's picture, -1 to 1 from left to right and from bottom to top; call it once per frame. None where it is the
    /// middle, or the runtime does not know.
    pub fn follow_gaze(&self, swapchain: &Swapchain<Vulkan>) -> Option<[Vec2; 2]> {
        if !self.follows_gaze {
            return None;
        }
        // The map is made anew for that.
        self.apply(swapchain).ok()?;
        let exts = self.session.instance().exts();
        let fp = exts.meta_foveation_eye_tracked.as_ref()?;
        let mut state = sys::FoveationEyeTrackedStateMETA {
            ty: sys::FoveationEyeTrackedStateMETA::TYPE,
            next: std::ptr::null_mut(),
            foveation_center: [openxr::Vector2f::default(); 2],
            flags: sys::FoveationEyeTrackedStateFlagsMETA::EMPTY,
        };
        // SAFETY: the session is alive, and `state` is whole.
        let result =
            unsafe { (fp.get_foveation_eye_tracked_state)(self.session.as_raw(), &mut state) };
        let valid = sys::FoveationEyeTrackedStateFlagsMETA::VALID;
        let known = outcome(result).is_ok() && state.flags.contains(valid);
        known.then(|| {
            state
                .foveation_center
                .map(|centre| Vec2::new(centre.x, centre.y))
        })
    }

    /// A swapchain's images that can be foveated, with the profile set, and their density maps.
    fn swapchain(
        &self,
        info: &SwapchainCreateInfo<Vulkan>,
    ) -> Result<(Swapchain<Vulkan>, Vec<DensityMap>), Absent> {
        let instance = self.session.instance();
        let mut foveated = sys::SwapchainCreateInfoFoveationFB {
            ty: sys::SwapchainCreateInfoFoveationFB::TYPE,
            next: std::ptr::null_mut(),
            flags: sys::SwapchainCreateFoveationFlagsFB::FRAGMENT_DENSITY_MAP,
        };
        let info = sys::SwapchainCreateInfo {
            ty: sys::SwapchainCreateInfo::TYPE,
            next: std::ptr::from_mut(&mut foveated).cast(),
            create_flags: info.create_flags,
            usage_flags: info.usage_flags,
            format: Vulkan::lower_format(info.format),
            sample_count: info.sample_count,
            width: info.width,
            height: info.height,
            face_count: info.face_count,
            array_size: info.array_size,
            mip_count: info.mip_count,
        };
        let mut handle = sys::Swapchain::NULL;
        // SAFETY: the session is alive; the chain lives on this stack until the call is over.
        let result =
            unsafe { (instance.fp().create_swapchain)(self.session.as_raw(), &info, &mut handle) };
        outcome(result).map_err(refused("xrCreateSwapchain"))?;
        // SAFETY: it was just made for this session, and nothing else destroys it.
        let swapchain = unsafe { Swapchain::from_raw(self.session.clone(), handle) };
        self.apply(&swapchain)?;
        let maps = self.density_maps(&swapchain)?;
        Ok((swapchain, maps))
    }

    /// Sets the profile on a swapchain.
    fn apply(&self, swapchain: &Swapchain<Vulkan>) -> Result<(), Absent> {
        let exts = self.session.instance().exts();
        let fp = exts
            .fb_swapchain_update_state
            .as_ref()
            .ok_or(Absent::NotGranted("XR_FB_swapchain_update_state"))?;
        let state = sys::SwapchainStateFoveationFB {
            ty: sys::SwapchainStateFoveationFB::TYPE,
            next: std::ptr::null_mut(),
            flags: sys::SwapchainStateFoveationFlagsFB::EMPTY,
            profile: self.profile,
        };
        // SAFETY: the structure opens with the header that is asked for; swapchain and profile are alive.
        let result =
            unsafe { (fp.update_swapchain)(swapchain.as_raw(), std::ptr::from_ref(&state).cast()) };
        outcome(result).map_err(refused("xrUpdateSwapchainFB"))?;
        Ok(())
    }

    /// The density maps of a swapchain's images, in the images' order; [`Absent`] where the runtime refuses to tell, or a map is
    /// none.
    fn density_maps(&self, swapchain: &Swapchain<Vulkan>) -> Result<Vec<DensityMap>, Absent> {
        let call = "xrEnumerateSwapchainImages";
        let fp = self.session.instance().fp();
        let mut count = 0;
        // SAFETY: the swapchain is alive; a capacity of 0 asks for the count alone.
        let result = unsafe {
            (fp.enumerate_swapchain_images)(swapchain.as_raw(), 0, &mut count, std::ptr::null_mut())
        };
        outcome(result).map_err(refused(call))?;
        let mut maps = vec![
            sys::SwapchainImageFoveationVulkanFB {
                ty: sys::SwapchainImageFoveationVulkanFB::TYPE,
                next: std::ptr::null_mut(),
                image: 0,
                width: 0,
                height: 0,
            };
            count as usize
        ];
        let mut images: Vec<_> = maps
            .iter_mut()
            .map(|map| sys::SwapchainImageVulkanKHR {
                ty: sys::SwapchainImageVulkanKHR::TYPE,
                next: std::ptr::from_mut(map).cast(),
                image: 0,
            })
            .collect();
        // SAFETY: there are `count` images, each with its own map chained, and both outlive the call.
        let result = unsafe {
            (fp.enumerate_swapchain_images)(
                swapchain.as_raw(),
                count,
                &mut count,
                images.as_mut_ptr().cast(),
            )
        };
        outcome(result).map_err(refused(call))?;
        let maps: Vec<_> = maps
            .iter()
            .map(|map| DensityMap {
                image: vk::Image::from_raw(map.image),
                width: map.width,
                height: map.height,
            })
            .collect();
        let whole = |map: &DensityMap| !map.image.is_null() && map.width > 0 && map.height > 0;
        if maps.iter().all(whole) {
            Ok(maps)
        } else {
            Err(Absent::NotBySystem("XR_FB_foveation_vulkan"))
        }
    }
}

impl Drop for Foveation {
    fn drop(&mut self) {
        if let Some(fp) = self.session.instance().exts().fb_foveation.as_ref() {
            // SAFETY: made by the session, which `self` keeps alive; swapchains keep what they need of it.
            unsafe { (fp.destroy_foveation_profile)(self.profile) };
        }
    }
}

/// A swapchain with its images' density maps where there is foveation; plain, without maps, where there is none or where the
/// runtime refuses it (which is logged).
///
/// # Errors
/// What the runtime says to a plain one.
pub fn swapchain(
    session: &Session<Vulkan>,
    foveation: Option<&Foveation>,
    info: &SwapchainCreateInfo<Vulkan>,
) -> Result<(Swapchain<Vulkan>, Vec<DensityMap>), XrError> {
    match foveation.map(|foveation| foveation.swapchain(info)) {
        Some(Ok(foveated)) => return Ok(foveated),
        Some(Err(why)) => log::warn!("drawing without foveation: {why}"),
        None => {}
    }
    let plain = session.create_swapchain(info).during("xrCreateSwapchain")?;
    Ok((plain, Vec::new()))
}

/// Whether foveation can follow the gaze.
fn tracks_gaze(session: &Session<Vulkan>, system: SystemId) -> bool {
    let instance = session.instance();
    if instance.exts().meta_foveation_eye_tracked.is_none() {
        return false;
    }
    let mut tracked = sys::SystemFoveationEyeTrackedPropertiesMETA {
        ty: sys::SystemFoveationEyeTrackedPropertiesMETA::TYPE,
        next: std::ptr::null_mut(),
        supports_foveation_eye_tracked: sys::FALSE,
    };
    // SAFETY: it may be chained to the system's properties where the extension is enabled.
    let asked = unsafe { ask_system(instance, system, &mut tracked) };
    asked.is_ok() && tracked.supports_foveation_eye_tracked.into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::FakeRuntime;
    use openxr::sys::Result as XrResult;
    use openxr::{SwapchainCreateFlags, SwapchainUsageFlags};

    const SRGB: u32 = 43;

    fn info() -> SwapchainCreateInfo<Vulkan> {
        SwapchainCreateInfo {
            create_flags: SwapchainCreateFlags::EMPTY,
            usage_flags: SwapchainUsageFlags::COLOR_ATTACHMENT,
            format: SRGB,
            sample_count: 1,
            width: 1680,
            height: 1760,
            face_count: 1,
            array_size: 2,
            mip_count: 1,
        }
    }

    #[test]
    fn a_foveated_swapchain_is_made_for_density_maps_and_gets_the_profile() {
        let fake = FakeRuntime::with_everything();
        let (session, _, _) = fake.session(&fake.instance());
        let foveation = Foveation::new(&session, fake.system(), true).expect("foveation");
        let profile = &fake.calls("xrCreateFoveationProfileFB")[0];
        assert!(profile.contains("(MEDIUM, LEVEL_ENABLED)"), "{profile}");
        let (_images, maps) = swapchain(&session, Some(&foveation), &info()).expect("images");
        let made = &fake.calls("xrCreateSwapchain")[0];
        let flags = sys::SwapchainCreateFoveationFlagsFB::FRAGMENT_DENSITY_MAP;
        assert!(made.contains(&format!("({flags:?})")), "{made}");
        assert!(made.starts_with("1680x1760x2 format 43 "), "{made}");
        assert_eq!(fake.calls("xrUpdateSwapchainFB").len(), 1, "profile set");
        assert_eq!(maps.len(), 3, "one for each image");
        assert_eq!((maps[0].width, maps[0].height), (53, 55), "texels");
        assert_ne!(maps[0].image, maps[1].image, "each its own");
    }

    #[test]
    fn it_is_around_the_gaze_where_that_is_tracked_and_in_the_middle_where_not() {
        let fake = FakeRuntime::with_everything();
        let (session, _, _) = fake.session(&fake.instance());
        let foveation = Foveation::new(&session, fake.system(), true).expect("foveation");
        assert!(foveation.follows_gaze(), "tracked");
        let chain = &fake.calls("xrCreateFoveationProfileFB")[0];
        assert!(chain.contains("EYE_TRACKED"), "{chain}");
        let (images, _) = swapchain(&session, Some(&foveation), &info()).expect("images");
        assert_eq!(foveation.follow_gaze(&images), None, "eyes are shut");
        fake.set(|world| world.gaze_centres = Some([[0.25, -0.5], [0.0, -0.5]]));
        fake.forget_calls();
        let centres = [Vec2::new(0.25, -0.5), Vec2::new(0.0, -0.5)];
        assert_eq!(
            foveation.follow_gaze(&images),
            Some(centres),
            "eyes are open"
        );
        let expected = ["xrUpdateSwapchainFB", "xrGetFoveationEyeTrackedStateMETA"];
        assert_eq!(fake.names(), expected, "the map is made anew first");

        fake.set(|world| world.system.foveation_around_gaze = false);
        let foveation = Foveation::new(&session, fake.system(), true).expect("foveation");
        assert!(!foveation.follows_gaze(), "not tracked");
        assert_eq!(foveation.follow_gaze(&images), None, "the middle");
        let chain = &fake.calls("xrCreateFoveationProfileFB")[0];
        assert!(!chain.contains("EYE_TRACKED"), "{chain}");
    }

    #[test]
    fn without_density_maps_on_the_device_there_is_none() {
        let fake = FakeRuntime::with_everything();
        let (session, _, _) = fake.session(&fake.instance());
        let why = Foveation::new(&session, fake.system(), false).expect_err("no maps");
        assert!(matches!(why, Absent::NotByDevice(_)), "{why}");
        swapchain(&session, None, &info()).expect("plain images");
        let made = &fake.calls("xrCreateSwapchain")[0];
        assert!(!made.contains("FOVEATION"), "{made}");
    }

    #[test]
    fn a_runtime_that_refuses_a_foveated_swapchain_gets_a_plain_one() {
        for refused in [
            "xrCreateSwapchain",
            "xrUpdateSwapchainFB",
            "xrEnumerateSwapchainImages",
        ] {
            let fake = FakeRuntime::with_everything();
            let (session, _, _) = fake.session(&fake.instance());
            let foveation = Foveation::new(&session, fake.system(), true).expect("foveation");
            fake.fail_times(refused, XrResult::ERROR_FEATURE_UNSUPPORTED, 1);
            let (_images, maps) =
                swapchain(&session, Some(&foveation), &info()).expect("plain images");
            let made = fake.calls("xrCreateSwapchain");
            assert!(!made[1].contains("FOVEATION"), "{made:?}");
            assert_eq!(fake.alive("swapchain"), 1, "the first is gone");
            assert_eq!(maps, [], "it has no maps");
        }
    }

    #[test]
    fn dropping_it_destroys_the_profile() {
        let fake = FakeRuntime::with_everything();
        let (session, _, _) = fake.session(&fake.instance());
        let foveation = Foveation::new(&session, fake.system(), true).expect("foveation");
        assert_eq!(fake.alive("foveation profile"), 1, "made");
        drop(foveation);
        assert_eq!(fake.alive("foveation profile"), 0, "gone");
    }
}
