//! The optional extensions' functions, and Vulkan's.

use std::ffi::c_void;

use ash::vk::{self, Handle as _};
use openxr::sys::platform::{VkDevice, VkInstance, VkPhysicalDevice, VkResult};
use openxr::sys::{self, Handle, Result as XrResult, StructureType};
use openxr::{SystemId, Version};

use super::call;
use super::device::Loader;
use super::pointers::{change, describe, give, read, values};
use super::world::World;

const OK: XrResult = XrResult::SUCCESS;

/// The system properties of an enabled extension.
pub(super) fn fill_system(world: &World, ty: StructureType, at: *mut c_void) {
    let system = &world.system;
    let has = |extension| world.has(extension);
    match ty {
        StructureType::SYSTEM_HAND_TRACKING_PROPERTIES_EXT if has("XR_EXT_hand_tracking") => {
            change(at.cast::<sys::SystemHandTrackingPropertiesEXT>(), |to| {
                to.supports_hand_tracking = system.hand_tracking.into();
            });
        }
        StructureType::SYSTEM_BODY_TRACKING_PROPERTIES_FB if has("XR_FB_body_tracking") => {
            change(at.cast::<sys::SystemBodyTrackingPropertiesFB>(), |to| {
                to.supports_body_tracking = system.body_tracking.into();
            });
        }
        StructureType::SYSTEM_PROPERTIES_BODY_TRACKING_FULL_BODY_META
            if has("XR_META_body_tracking_full_body") =>
        {
            change(
                at.cast::<sys::SystemPropertiesBodyTrackingFullBodyMETA>(),
                |to| to.supports_full_body_tracking = system.full_body.into(),
            );
        }
        StructureType::SYSTEM_PROPERTIES_BODY_TRACKING_FIDELITY_META
            if has("XR_META_body_tracking_fidelity") =>
        {
            change(
                at.cast::<sys::SystemPropertiesBodyTrackingFidelityMETA>(),
                |to| to.supports_body_tracking_fidelity = system.body_fidelity.into(),
            );
        }
        StructureType::SYSTEM_FACE_TRACKING_PROPERTIES2_FB if has("XR_FB_face_tracking2") => {
            change(at.cast::<sys::SystemFaceTrackingProperties2FB>(), |to| {
                to.supports_visual_face_tracking = system.face_seen.into();
                to.supports_audio_face_tracking = system.face_heard.into();
            });
        }
        StructureType::SYSTEM_EYE_TRACKING_PROPERTIES_FB if has("XR_FB_eye_tracking_social") => {
            change(at.cast::<sys::SystemEyeTrackingPropertiesFB>(), |to| {
                to.supports_eye_tracking = system.eye_tracking.into();
            });
        }
        StructureType::SYSTEM_EYE_GAZE_INTERACTION_PROPERTIES_EXT
            if has("XR_EXT_eye_gaze_interaction") =>
        {
            change(
                at.cast::<sys::SystemEyeGazeInteractionPropertiesEXT>(),
                |to| to.supports_eye_gaze_interaction = system.eye_gaze.into(),
            );
        }
        StructureType::SYSTEM_PASSTHROUGH_PROPERTIES_FB if has("XR_FB_passthrough") => {
            change(at.cast::<sys::SystemPassthroughPropertiesFB>(), |to| {
                to.supports_passthrough = system.passthrough_of_old.into();
            });
        }
        StructureType::SYSTEM_PASSTHROUGH_PROPERTIES2_FB
            if has("XR_FB_passthrough") && system.passthrough =>
        {
            change(at.cast::<sys::SystemPassthroughProperties2FB>(), |to| {
                to.capabilities = sys::PassthroughCapabilityFlagsFB::PASSTHROUGH_CAPABILITY
                    | sys::PassthroughCapabilityFlagsFB::COLOR;
            });
        }
        StructureType::SYSTEM_FOVEATION_EYE_TRACKED_PROPERTIES_META
            if has("XR_META_foveation_eye_tracked") =>
        {
            change(
                at.cast::<sys::SystemFoveationEyeTrackedPropertiesMETA>(),
                |to| to.supports_foveation_eye_tracked = system.foveation_around_gaze.into(),
            );
        }
        _ => {}
    }
}

// XR_KHR_vulkan_enable2: dummy handles, unless the test asks for the machine's own Vulkan.

pub(super) unsafe extern "system" fn create_vulkan_instance(
    instance: sys::Instance,
    info: *const sys::VulkanInstanceCreateInfoKHR,
    out: *mut VkInstance,
    result: *mut VkResult,
) -> XrResult {
    let info = read(info);
    call(instance, "xrCreateVulkanInstanceKHR", "", |world| {
        if !world.vulkan {
            give(result, 0);
            return give(out, std::ptr::without_provenance(0x10));
        }
        let loader = Loader::new(info.pfn_get_instance_proc_addr);
        let (said, made) = loader.create_instance(info.vulkan_create_info.cast());
        world.loader = Some(loader);
        world.vulkan_instance = made;
        give(result, said.as_raw());
        give(out, made.as_raw() as VkInstance)
    })
}

pub(super) unsafe extern "system" fn create_vulkan_device(
    instance: sys::Instance,
    info: *const sys::VulkanDeviceCreateInfoKHR,
    out: *mut VkDevice,
    result: *mut VkResult,
) -> XrResult {
    let info = read(info);
    call(instance, "xrCreateVulkanDeviceKHR", "", |world| {
        let Some(loader) = &world.loader else {
            give(result, 0);
            return give(out, std::ptr::without_provenance(0x30));
        };
        let physical = vk::PhysicalDevice::from_raw(info.vulkan_physical_device as u64);
        let (said, made) = loader.create_device(
            world.vulkan_instance,
            physical,
            info.vulkan_create_info.cast(),
        );
        give(result, said.as_raw());
        give(out, made.as_raw() as VkDevice)
    })
}

pub(super) unsafe extern "system" fn get_vulkan_device(
    instance: sys::Instance,
    info: *const sys::VulkanGraphicsDeviceGetInfoKHR,
    out: *mut VkPhysicalDevice,
) -> XrResult {
    let of = vk::Instance::from_raw(read(info).vulkan_instance as u64);
    call(instance, "xrGetVulkanGraphicsDevice2KHR", "", |world| {
        let device = match &world.loader {
            Some(loader) => loader.physical_device(of).as_raw() as VkPhysicalDevice,
            None => std::ptr::without_provenance(0x20),
        };
        give(out, device)
    })
}

pub(super) unsafe extern "system" fn get_vulkan_requirements(
    instance: sys::Instance,
    _system: SystemId,
    out: *mut sys::GraphicsRequirementsVulkanKHR,
) -> XrResult {
    let name = "xrGetVulkanGraphicsRequirements2KHR";
    call(instance, name, "", |_| {
        change(out, |to| {
            to.min_api_version_supported = Version::new(1, 0, 0);
            to.max_api_version_supported = Version::new(1, 4, 0);
        })
    })
}

// XR_KHR_convert_timespec_time: both clocks are one. A `timespec` is two 64-bit integers.

pub(super) unsafe extern "system" fn timespec_to_time(
    instance: sys::Instance,
    timespec: *const [i64; 2],
    time: *mut sys::Time,
) -> XrResult {
    let [seconds, nanos] = read(timespec);
    call(instance, "xrConvertTimespecTimeToTimeKHR", "", |_| {
        give(time, sys::Time::from_nanos(seconds * 1_000_000_000 + nanos))
    })
}

pub(super) unsafe extern "system" fn time_to_timespec(
    instance: sys::Instance,
    time: sys::Time,
    timespec: *mut [i64; 2],
) -> XrResult {
    let nanos = time.as_nanos();
    call(instance, "xrConvertTimeToTimespecTimeKHR", "", |_| {
        give(timespec, [nanos / 1_000_000_000, nanos % 1_000_000_000])
    })
}

// XR_FB_display_refresh_rate.

pub(super) unsafe extern "system" fn enumerate_rates(
    session: sys::Session,
    capacity: u32,
    count: *mut u32,
    out: *mut f32,
) -> XrResult {
    call(session, "xrEnumerateDisplayRefreshRatesFB", "", |world| {
        values(capacity, count, out, &world.rates_hz)
    })
}

pub(super) unsafe extern "system" fn get_rate(session: sys::Session, out: *mut f32) -> XrResult {
    call(session, "xrGetDisplayRefreshRateFB", "", |world| {
        give(out, world.rate_hz)
    })
}

pub(super) unsafe extern "system" fn request_rate(session: sys::Session, hz: f32) -> XrResult {
    let name = "xrRequestDisplayRefreshRateFB";
    call(session, name, hz.to_string(), |world| {
        if !world.rates_hz.contains(&hz) {
            return XrResult::ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB;
        }
        world.rate_hz = hz;
        OK
    })
}

// XR_FB_passthrough.

pub(super) unsafe extern "system" fn create_passthrough(
    session: sys::Session,
    info: *const sys::PassthroughCreateInfoFB,
    out: *mut sys::PassthroughFB,
) -> XrResult {
    let flags = read(info).flags;
    call(
        session,
        "xrCreatePassthroughFB",
        format!("{flags:?}"),
        |world| {
            world.make("passthrough", out);
            OK
        },
    )
}

pub(super) unsafe extern "system" fn destroy_passthrough(it: sys::PassthroughFB) -> XrResult {
    call(it, "xrDestroyPassthroughFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn start_passthrough(it: sys::PassthroughFB) -> XrResult {
    call(it, "xrPassthroughStartFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn pause_passthrough(it: sys::PassthroughFB) -> XrResult {
    call(it, "xrPassthroughPauseFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn create_passthrough_layer(
    session: sys::Session,
    info: *const sys::PassthroughLayerCreateInfoFB,
    out: *mut sys::PassthroughLayerFB,
) -> XrResult {
    let info = read(info);
    let said = format!("{:?}", info.purpose);
    call(session, "xrCreatePassthroughLayerFB", said, |world| {
        if !world.alive.contains_key(&info.passthrough.into_raw()) {
            return XrResult::ERROR_HANDLE_INVALID;
        }
        world.make("passthrough layer", out);
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_passthrough_layer(
    it: sys::PassthroughLayerFB,
) -> XrResult {
    call(it, "xrDestroyPassthroughLayerFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn pause_passthrough_layer(
    it: sys::PassthroughLayerFB,
) -> XrResult {
    call(it, "xrPassthroughLayerPauseFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn resume_passthrough_layer(
    it: sys::PassthroughLayerFB,
) -> XrResult {
    call(it, "xrPassthroughLayerResumeFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn set_passthrough_style(
    it: sys::PassthroughLayerFB,
    _style: *const sys::PassthroughStyleFB,
) -> XrResult {
    call(it, "xrPassthroughLayerSetStyleFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn create_geometry(
    session: sys::Session,
    _info: *const sys::GeometryInstanceCreateInfoFB,
    _out: *mut sys::GeometryInstanceFB,
) -> XrResult {
    call(session, "xrCreateGeometryInstanceFB", "", |_| {
        XrResult::ERROR_FEATURE_UNSUPPORTED
    })
}

pub(super) unsafe extern "system" fn destroy_geometry(it: sys::GeometryInstanceFB) -> XrResult {
    call(it, "xrDestroyGeometryInstanceFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn move_geometry(
    it: sys::GeometryInstanceFB,
    _transform: *const sys::GeometryInstanceTransformFB,
) -> XrResult {
    call(it, "xrGeometryInstanceSetTransformFB", "", |_| OK)
}

// XR_FB_foveation, XR_FB_swapchain_update_state, XR_META_foveation_eye_tracked.

pub(super) unsafe extern "system" fn create_foveation(
    session: sys::Session,
    info: *const sys::FoveationProfileCreateInfoFB,
    out: *mut sys::FoveationProfileFB,
) -> XrResult {
    let chain = describe(read(info).next);
    call(session, "xrCreateFoveationProfileFB", chain, |world| {
        world.make("foveation profile", out);
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_foveation(it: sys::FoveationProfileFB) -> XrResult {
    call(it, "xrDestroyFoveationProfileFB", "", |_| OK)
}

pub(super) unsafe extern "system" fn update_swapchain(
    swapchain: sys::Swapchain,
    state: *const sys::SwapchainStateBaseHeaderFB,
) -> XrResult {
    let header = read(state);
    let said = format!("{:?}", header.ty);
    call(swapchain, "xrUpdateSwapchainFB", said, |world| {
        if header.ty != sys::SwapchainStateFoveationFB::TYPE {
            return XrResult::ERROR_VALIDATION_FAILURE;
        }
        let state: sys::SwapchainStateFoveationFB = read(state.cast());
        if !world.alive.contains_key(&state.profile.into_raw()) {
            return XrResult::ERROR_HANDLE_INVALID;
        }
        OK
    })
}

pub(super) unsafe extern "system" fn get_swapchain_state(
    swapchain: sys::Swapchain,
    _state: *mut sys::SwapchainStateBaseHeaderFB,
) -> XrResult {
    call(swapchain, "xrGetSwapchainStateFB", "", |_| {
        XrResult::ERROR_FEATURE_UNSUPPORTED
    })
}

pub(super) unsafe extern "system" fn get_gaze_centres(
    session: sys::Session,
    state: *mut sys::FoveationEyeTrackedStateMETA,
) -> XrResult {
    call(session, "xrGetFoveationEyeTrackedStateMETA", "", |world| {
        change(state, |to| {
            if let Some(centres) = world.gaze_centres {
                to.flags = sys::FoveationEyeTrackedStateFlagsMETA::VALID;
                to.foveation_center = centres.map(|[x, y]| openxr::Vector2f { x, y });
            }
        })
    })
}

// XR_EXT_performance_settings.

pub(super) unsafe extern "system" fn set_performance(
    session: sys::Session,
    domain: sys::PerfSettingsDomainEXT,
    level: sys::PerfSettingsLevelEXT,
) -> XrResult {
    let name = "xrPerfSettingsSetPerformanceLevelEXT";
    call(session, name, format!("{domain:?} {level:?}"), |_| OK)
}
