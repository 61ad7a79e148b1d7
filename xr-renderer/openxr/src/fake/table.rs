//! The functions by their names. Those of an extension are there once an instance has enabled it.

use std::ffi::c_char;

use openxr::sys::{self, Handle, Result as XrResult, pfn};

use super::pointers::{give, text};
use super::{RUNTIMES, actions, lenses, locked, runtime, session, swapchain, trackers, vendor};

/// Every extension that this runtime can do.
pub(super) const EXTENSIONS: &[&str] = &[
    CORE_VULKAN,
    TIMESPEC,
    "XR_EXT_local_floor",
    "XR_KHR_composition_layer_depth",
    MASK,
    HANDS,
    BODY,
    "XR_META_body_tracking_full_body",
    FIDELITY,
    FACE,
    EYES,
    "XR_EXT_eye_gaze_interaction",
    PASSTHROUGH,
    RATE,
    UPDATE,
    FOVEATION,
    "XR_FB_foveation_configuration",
    "XR_FB_foveation_vulkan",
    GAZE_FOVEATION,
    PERFORMANCE,
];

const CORE_VULKAN: &str = super::REQUIRED;
const TIMESPEC: &str = "XR_KHR_convert_timespec_time";
const MASK: &str = "XR_KHR_visibility_mask";
const HANDS: &str = "XR_EXT_hand_tracking";
const BODY: &str = "XR_FB_body_tracking";
const FIDELITY: &str = "XR_META_body_tracking_fidelity";
const FACE: &str = "XR_FB_face_tracking2";
const EYES: &str = "XR_FB_eye_tracking_social";
const PASSTHROUGH: &str = "XR_FB_passthrough";
const RATE: &str = "XR_FB_display_refresh_rate";
const UPDATE: &str = "XR_FB_swapchain_update_state";
const FOVEATION: &str = "XR_FB_foveation";
const GAZE_FOVEATION: &str = "XR_META_foveation_eye_tracked";
const PERFORMANCE: &str = "XR_EXT_performance_settings";

/// A function without its type, given that it has the one that its name has.
macro_rules! function {
    ($ty:ty, $function:expr) => {{
        let typed: $ty = $function;
        // SAFETY: function pointers are of one size; callers turn it back into the type of its name.
        Some(unsafe { std::mem::transmute::<$ty, pfn::VoidFunction>(typed) })
    }};
}

pub(super) unsafe extern "system" fn get_instance_proc_addr(
    instance: sys::Instance,
    name: *const c_char,
    out: *mut Option<pfn::VoidFunction>,
) -> XrResult {
    let name = text(name);
    let found = core(&name)
        .or_else(|| session(&name))
        .or_else(|| images(&name))
        .or_else(|| input(&name))
        .or_else(|| optional(&name).and_then(|(of, it)| is_enabled(instance, of).then_some(it)?));
    give(out, found);
    match found {
        Some(_) => XrResult::SUCCESS,
        None => XrResult::ERROR_FUNCTION_UNSUPPORTED,
    }
}

fn is_enabled(instance: sys::Instance, extension: &str) -> bool {
    let id = (instance.into_raw() >> 32) as u32;
    let world = locked(&RUNTIMES).get(&id).cloned();
    world.is_some_and(|world| locked(&world).has(extension))
}

fn core(name: &str) -> Option<pfn::VoidFunction> {
    use runtime as it;
    match name {
        "xrGetInstanceProcAddr" => function!(pfn::GetInstanceProcAddr, get_instance_proc_addr),
        "xrEnumerateApiLayerProperties" => {
            function!(pfn::EnumerateApiLayerProperties, it::enumerate_layers)
        }
        "xrEnumerateInstanceExtensionProperties" => function!(
            pfn::EnumerateInstanceExtensionProperties,
            it::enumerate_extensions
        ),
        "xrCreateInstance" => function!(pfn::CreateInstance, it::create_instance),
        "xrDestroyInstance" => function!(pfn::DestroyInstance, it::destroy_instance),
        "xrResultToString" => function!(pfn::ResultToString, it::result_to_string),
        "xrStructureTypeToString" => {
            function!(pfn::StructureTypeToString, it::structure_type_to_string)
        }
        "xrGetInstanceProperties" => {
            function!(pfn::GetInstanceProperties, it::get_instance_properties)
        }
        "xrPollEvent" => function!(pfn::PollEvent, it::poll_event),
        "xrStringToPath" => function!(pfn::StringToPath, it::string_to_path),
        "xrPathToString" => function!(pfn::PathToString, it::path_to_string),
        "xrGetSystem" => function!(pfn::GetSystem, it::get_system),
        "xrGetSystemProperties" => function!(pfn::GetSystemProperties, it::get_system_properties),
        "xrEnumerateViewConfigurations" => function!(
            pfn::EnumerateViewConfigurations,
            it::enumerate_view_configurations
        ),
        "xrEnumerateEnvironmentBlendModes" => {
            function!(
                pfn::EnumerateEnvironmentBlendModes,
                it::enumerate_blend_modes
            )
        }
        "xrGetViewConfigurationProperties" => function!(
            pfn::GetViewConfigurationProperties,
            it::get_view_configuration_properties
        ),
        "xrEnumerateViewConfigurationViews" => {
            function!(pfn::EnumerateViewConfigurationViews, it::enumerate_views)
        }
        _ => None,
    }
}

fn session(name: &str) -> Option<pfn::VoidFunction> {
    use session as it;
    match name {
        "xrCreateSession" => function!(pfn::CreateSession, it::create_session),
        "xrDestroySession" => function!(pfn::DestroySession, it::destroy_session),
        "xrBeginSession" => function!(pfn::BeginSession, it::begin_session),
        "xrEndSession" => function!(pfn::EndSession, it::end_session),
        "xrRequestExitSession" => function!(pfn::RequestExitSession, it::request_exit),
        "xrWaitFrame" => function!(pfn::WaitFrame, it::wait_frame),
        "xrBeginFrame" => function!(pfn::BeginFrame, it::begin_frame),
        "xrEndFrame" => function!(pfn::EndFrame, it::end_frame),
        "xrEnumerateReferenceSpaces" => {
            function!(
                pfn::EnumerateReferenceSpaces,
                it::enumerate_reference_spaces
            )
        }
        "xrGetReferenceSpaceBoundsRect" => {
            function!(pfn::GetReferenceSpaceBoundsRect, it::get_bounds)
        }
        "xrCreateReferenceSpace" => {
            function!(pfn::CreateReferenceSpace, it::create_reference_space)
        }
        "xrCreateActionSpace" => function!(pfn::CreateActionSpace, it::create_action_space),
        "xrDestroySpace" => function!(pfn::DestroySpace, it::destroy_space),
        "xrLocateSpace" => function!(pfn::LocateSpace, it::locate_space),
        "xrLocateViews" => function!(pfn::LocateViews, it::locate_views),
        _ => None,
    }
}

fn images(name: &str) -> Option<pfn::VoidFunction> {
    use swapchain as it;
    match name {
        "xrEnumerateSwapchainFormats" => {
            function!(pfn::EnumerateSwapchainFormats, it::enumerate_formats)
        }
        "xrCreateSwapchain" => function!(pfn::CreateSwapchain, it::create_swapchain),
        "xrDestroySwapchain" => function!(pfn::DestroySwapchain, it::destroy_swapchain),
        "xrEnumerateSwapchainImages" => {
            function!(pfn::EnumerateSwapchainImages, it::enumerate_images)
        }
        "xrAcquireSwapchainImage" => function!(pfn::AcquireSwapchainImage, it::acquire_image),
        "xrWaitSwapchainImage" => function!(pfn::WaitSwapchainImage, it::wait_image),
        "xrReleaseSwapchainImage" => function!(pfn::ReleaseSwapchainImage, it::release_image),
        _ => None,
    }
}

fn input(name: &str) -> Option<pfn::VoidFunction> {
    use actions as it;
    match name {
        "xrCreateActionSet" => function!(pfn::CreateActionSet, it::create_action_set),
        "xrDestroyActionSet" => function!(pfn::DestroyActionSet, it::destroy_action_set),
        "xrCreateAction" => function!(pfn::CreateAction, it::create_action),
        "xrDestroyAction" => function!(pfn::DestroyAction, it::destroy_action),
        "xrSuggestInteractionProfileBindings" => {
            function!(pfn::SuggestInteractionProfileBindings, it::suggest_bindings)
        }
        "xrAttachSessionActionSets" => {
            function!(pfn::AttachSessionActionSets, it::attach_action_sets)
        }
        "xrGetCurrentInteractionProfile" => {
            function!(pfn::GetCurrentInteractionProfile, it::get_current_profile)
        }
        "xrSyncActions" => function!(pfn::SyncActions, it::sync_actions),
        "xrGetActionStateBoolean" => function!(pfn::GetActionStateBoolean, it::get_boolean),
        "xrGetActionStateFloat" => function!(pfn::GetActionStateFloat, it::get_float),
        "xrGetActionStateVector2f" => function!(pfn::GetActionStateVector2f, it::get_vector),
        "xrGetActionStatePose" => function!(pfn::GetActionStatePose, it::get_pose),
        "xrEnumerateBoundSourcesForAction" => function!(
            pfn::EnumerateBoundSourcesForAction,
            it::enumerate_bound_sources
        ),
        "xrGetInputSourceLocalizedName" => {
            function!(pfn::GetInputSourceLocalizedName, it::get_source_name)
        }
        "xrApplyHapticFeedback" => function!(pfn::ApplyHapticFeedback, it::apply_haptics),
        "xrStopHapticFeedback" => function!(pfn::StopHapticFeedback, it::stop_haptics),
        _ => None,
    }
}

/// An extension's function, with the extension.
fn optional(name: &str) -> Option<(&'static str, Option<pfn::VoidFunction>)> {
    use vendor as it;
    /// Time as two 64-bit integers, which is what the C library's is on 64-bit systems.
    type ToTime =
        unsafe extern "system" fn(sys::Instance, *const [i64; 2], *mut sys::Time) -> XrResult;
    type FromTime = unsafe extern "system" fn(sys::Instance, sys::Time, *mut [i64; 2]) -> XrResult;
    Some(match name {
        "xrCreateVulkanInstanceKHR" => (
            CORE_VULKAN,
            function!(pfn::CreateVulkanInstanceKHR, it::create_vulkan_instance),
        ),
        "xrCreateVulkanDeviceKHR" => (
            CORE_VULKAN,
            function!(pfn::CreateVulkanDeviceKHR, it::create_vulkan_device),
        ),
        "xrGetVulkanGraphicsDevice2KHR" => (
            CORE_VULKAN,
            function!(pfn::GetVulkanGraphicsDevice2KHR, it::get_vulkan_device),
        ),
        "xrGetVulkanGraphicsRequirements2KHR" => (
            CORE_VULKAN,
            function!(
                pfn::GetVulkanGraphicsRequirements2KHR,
                it::get_vulkan_requirements
            ),
        ),
        "xrConvertTimespecTimeToTimeKHR" => (TIMESPEC, function!(ToTime, it::timespec_to_time)),
        "xrConvertTimeToTimespecTimeKHR" => (TIMESPEC, function!(FromTime, it::time_to_timespec)),
        "xrGetVisibilityMaskKHR" => (
            MASK,
            function!(pfn::GetVisibilityMaskKHR, lenses::get_visibility_mask),
        ),
        "xrCreateHandTrackerEXT" => (
            HANDS,
            function!(pfn::CreateHandTrackerEXT, actions::create_hand_tracker),
        ),
        "xrDestroyHandTrackerEXT" => (
            HANDS,
            function!(pfn::DestroyHandTrackerEXT, actions::destroy_hand_tracker),
        ),
        "xrLocateHandJointsEXT" => (
            HANDS,
            function!(pfn::LocateHandJointsEXT, actions::locate_hand_joints),
        ),
        "xrEnumerateDisplayRefreshRatesFB" => (
            RATE,
            function!(pfn::EnumerateDisplayRefreshRatesFB, it::enumerate_rates),
        ),
        "xrGetDisplayRefreshRateFB" => {
            (RATE, function!(pfn::GetDisplayRefreshRateFB, it::get_rate))
        }
        "xrRequestDisplayRefreshRateFB" => (
            RATE,
            function!(pfn::RequestDisplayRefreshRateFB, it::request_rate),
        ),
        "xrCreateFoveationProfileFB" => (
            FOVEATION,
            function!(pfn::CreateFoveationProfileFB, it::create_foveation),
        ),
        "xrDestroyFoveationProfileFB" => (
            FOVEATION,
            function!(pfn::DestroyFoveationProfileFB, it::destroy_foveation),
        ),
        "xrUpdateSwapchainFB" => (
            UPDATE,
            function!(pfn::UpdateSwapchainFB, it::update_swapchain),
        ),
        "xrGetSwapchainStateFB" => (
            UPDATE,
            function!(pfn::GetSwapchainStateFB, it::get_swapchain_state),
        ),
        "xrGetFoveationEyeTrackedStateMETA" => (
            GAZE_FOVEATION,
            function!(pfn::GetFoveationEyeTrackedStateMETA, it::get_gaze_centres),
        ),
        "xrPerfSettingsSetPerformanceLevelEXT" => (
            PERFORMANCE,
            function!(pfn::PerfSettingsSetPerformanceLevelEXT, it::set_performance),
        ),
        name => match wearer(name) {
            Some((of, it)) => (of, Some(it)),
            None => (PASSTHROUGH, passthrough(name)),
        },
    })
}

/// A function of what watches the wearer, with the extension.
fn wearer(name: &str) -> Option<(&'static str, pfn::VoidFunction)> {
    use trackers as it;
    let (of, found) = match name {
        "xrCreateBodyTrackerFB" => (
            BODY,
            function!(pfn::CreateBodyTrackerFB, it::create_body_tracker),
        ),
        "xrDestroyBodyTrackerFB" => (
            BODY,
            function!(pfn::DestroyBodyTrackerFB, it::destroy_body_tracker),
        ),
        "xrLocateBodyJointsFB" => (
            BODY,
            function!(pfn::LocateBodyJointsFB, it::locate_body_joints),
        ),
        "xrGetBodySkeletonFB" => (
            BODY,
            function!(pfn::GetBodySkeletonFB, it::get_body_skeleton),
        ),
        "xrRequestBodyTrackingFidelityMETA" => (
            FIDELITY,
            function!(
                pfn::RequestBodyTrackingFidelityMETA,
                it::request_body_fidelity
            ),
        ),
        "xrCreateFaceTracker2FB" => (
            FACE,
            function!(pfn::CreateFaceTracker2FB, it::create_face_tracker),
        ),
        "xrDestroyFaceTracker2FB" => (
            FACE,
            function!(pfn::DestroyFaceTracker2FB, it::destroy_face_tracker),
        ),
        "xrGetFaceExpressionWeights2FB" => (
            FACE,
            function!(pfn::GetFaceExpressionWeights2FB, it::get_face_weights),
        ),
        "xrCreateEyeTrackerFB" => (
            EYES,
            function!(pfn::CreateEyeTrackerFB, it::create_eye_tracker),
        ),
        "xrDestroyEyeTrackerFB" => (
            EYES,
            function!(pfn::DestroyEyeTrackerFB, it::destroy_eye_tracker),
        ),
        "xrGetEyeGazesFB" => (EYES, function!(pfn::GetEyeGazesFB, it::get_eye_gazes)),
        _ => return None,
    };
    Some((of, found?))
}

fn passthrough(name: &str) -> Option<pfn::VoidFunction> {
    use vendor as it;
    match name {
        "xrCreatePassthroughFB" => function!(pfn::CreatePassthroughFB, it::create_passthrough),
        "xrDestroyPassthroughFB" => function!(pfn::DestroyPassthroughFB, it::destroy_passthrough),
        "xrPassthroughStartFB" => function!(pfn::PassthroughStartFB, it::start_passthrough),
        "xrPassthroughPauseFB" => function!(pfn::PassthroughPauseFB, it::pause_passthrough),
        "xrCreatePassthroughLayerFB" => {
            function!(pfn::CreatePassthroughLayerFB, it::create_passthrough_layer)
        }
        "xrDestroyPassthroughLayerFB" => {
            function!(
                pfn::DestroyPassthroughLayerFB,
                it::destroy_passthrough_layer
            )
        }
        "xrPassthroughLayerPauseFB" => {
            function!(pfn::PassthroughLayerPauseFB, it::pause_passthrough_layer)
        }
        "xrPassthroughLayerResumeFB" => {
            function!(pfn::PassthroughLayerResumeFB, it::resume_passthrough_layer)
        }
        "xrPassthroughLayerSetStyleFB" => {
            function!(pfn::PassthroughLayerSetStyleFB, it::set_passthrough_style)
        }
        "xrCreateGeometryInstanceFB" => {
            function!(pfn::CreateGeometryInstanceFB, it::create_geometry)
        }
        "xrDestroyGeometryInstanceFB" => {
            function!(pfn::DestroyGeometryInstanceFB, it::destroy_geometry)
        }
        "xrGeometryInstanceSetTransformFB" => {
            function!(pfn::GeometryInstanceSetTransformFB, it::move_geometry)
        }
        _ => None,
    }
}
