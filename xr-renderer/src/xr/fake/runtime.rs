//! The core's functions.

use std::ffi::c_char;

use openxr::sys::{self, Handle, Result as XrResult};
use openxr::{
    EnvironmentBlendMode, Path, ReferenceSpaceType, SessionState, SpaceLocationFlags, SystemId,
    Time, Version, ViewConfigurationType, ViewStateFlags,
};

use super::pointers::{chained, change, describe, give, layers, list, put_text, read, read_all};
use super::pointers::{text, values};
use super::world::{FakeSwapchain, Place};
use super::{EndedFrame, SYSTEM, call, call_here, device};
use crate::xr::pose::{posef, rigid};

const OK: XrResult = XrResult::SUCCESS;

/// So many images has a swapchain.
const IMAGES: u32 = 3;

// Instances.

pub(super) unsafe extern "system" fn enumerate_extensions(
    layer: *const c_char,
    capacity: u32,
    count: *mut u32,
    out: *mut sys::ExtensionProperties,
) -> XrResult {
    assert!(layer.is_null(), "there are no API layers");
    call_here("xrEnumerateInstanceExtensionProperties", "", |world| {
        list(capacity, count, out, &world.extensions, |to, name| {
            change(to, |to| {
                put_text(&mut to.extension_name, name);
                to.extension_version = 1;
            });
        })
    })
}

pub(super) unsafe extern "system" fn enumerate_layers(
    capacity: u32,
    count: *mut u32,
    out: *mut sys::ApiLayerProperties,
) -> XrResult {
    values(capacity, count, out, &[])
}

pub(super) unsafe extern "system" fn create_instance(
    info: *const sys::InstanceCreateInfo,
    instance: *mut sys::Instance,
) -> XrResult {
    let info = read(info);
    let names: Vec<String> = read_all(info.enabled_extension_names, info.enabled_extension_count)
        .into_iter()
        .map(text)
        .collect();
    call_here("xrCreateInstance", names.join(" "), |world| {
        let lacking = |name: &&String| !world.extensions.contains(&name.as_str());
        if names.iter().any(|name| lacking(&name)) {
            return XrResult::ERROR_EXTENSION_NOT_PRESENT;
        }
        world.enabled = names.clone();
        world.instance_lost = false;
        world.make("instance", instance);
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_instance(instance: sys::Instance) -> XrResult {
    call(instance, "xrDestroyInstance", "", |_| OK)
}

pub(super) unsafe extern "system" fn result_to_string(
    instance: sys::Instance,
    value: XrResult,
    buffer: *mut c_char,
) -> XrResult {
    call(instance, "xrResultToString", "", |_| {
        change(
            buffer.cast::<[c_char; sys::MAX_RESULT_STRING_SIZE]>(),
            |to| {
                put_text(&mut to[..], &format!("{value:?}"));
            },
        )
    })
}

pub(super) unsafe extern "system" fn structure_type_to_string(
    instance: sys::Instance,
    value: sys::StructureType,
    buffer: *mut c_char,
) -> XrResult {
    call(instance, "xrStructureTypeToString", "", |_| {
        change(
            buffer.cast::<[c_char; sys::MAX_STRUCTURE_NAME_SIZE]>(),
            |to| put_text(&mut to[..], &format!("{value:?}")),
        )
    })
}

pub(super) unsafe extern "system" fn get_instance_properties(
    instance: sys::Instance,
    out: *mut sys::InstanceProperties,
) -> XrResult {
    call(instance, "xrGetInstanceProperties", "", |_| {
        change(out, |to| {
            to.runtime_version = Version::new(1, 2, 3);
            put_text(&mut to.runtime_name, "Fake");
        })
    })
}

pub(super) unsafe extern "system" fn poll_event(
    instance: sys::Instance,
    out: *mut sys::EventDataBuffer,
) -> XrResult {
    call(instance, "xrPollEvent", "", |world| {
        match world.events.pop_front() {
            Some(event) => give(out, event.0),
            None => XrResult::EVENT_UNAVAILABLE,
        }
    })
}

pub(super) unsafe extern "system" fn string_to_path(
    instance: sys::Instance,
    string: *const c_char,
    path: *mut Path,
) -> XrResult {
    let string = text(string);
    call(instance, "xrStringToPath", &string, |world| {
        if !string.starts_with('/') {
            return XrResult::ERROR_PATH_FORMAT_INVALID;
        }
        give(path, Path::from_raw(world.path_of(&string)))
    })
}

pub(super) unsafe extern "system" fn path_to_string(
    instance: sys::Instance,
    path: Path,
    capacity: u32,
    count: *mut u32,
    buffer: *mut c_char,
) -> XrResult {
    call(instance, "xrPathToString", "", |world| {
        let Some(path) = world.path(path.into_raw()) else {
            return XrResult::ERROR_PATH_INVALID;
        };
        let bytes: Vec<c_char> = path.bytes().chain([0]).map(|byte| byte as c_char).collect();
        values(capacity, count, buffer, &bytes)
    })
}

// Systems.

pub(super) unsafe extern "system" fn get_system(
    instance: sys::Instance,
    info: *const sys::SystemGetInfo,
    system: *mut SystemId,
) -> XrResult {
    let form = read(info).form_factor;
    call(instance, "xrGetSystem", format!("{form:?}"), |_| {
        give(system, SystemId::from_raw(SYSTEM))
    })
}

pub(super) unsafe extern "system" fn get_system_properties(
    instance: sys::Instance,
    system: SystemId,
    out: *mut sys::SystemProperties,
) -> XrResult {
    // Our callers set type and chain, and nothing else.
    let head: sys::BaseInStructure = read(out.cast());
    let chain = describe(head.next.cast());
    call(instance, "xrGetSystemProperties", chain, |world| {
        if system.into_raw() != SYSTEM {
            return XrResult::ERROR_SYSTEM_INVALID;
        }
        for (ty, at) in chained(head.next.cast()) {
            super::vendor::fill_system(world, ty, at);
        }
        let mut name = [0; sys::MAX_SYSTEM_NAME_SIZE];
        put_text(&mut name, "Fake headset");
        let next = head.next.cast_mut().cast();
        give(
            out,
            sys::SystemProperties {
                ty: sys::SystemProperties::TYPE,
                next,
                system_id: system,
                vendor_id: 1,
                system_name: name,
                graphics_properties: sys::SystemGraphicsProperties {
                    max_swapchain_image_height: 4096,
                    max_swapchain_image_width: 4096,
                    max_layer_count: 16,
                },
                tracking_properties: sys::SystemTrackingProperties {
                    orientation_tracking: sys::TRUE,
                    position_tracking: sys::TRUE,
                },
            },
        )
    })
}

pub(super) unsafe extern "system" fn enumerate_view_configurations(
    instance: sys::Instance,
    _system: SystemId,
    capacity: u32,
    count: *mut u32,
    out: *mut ViewConfigurationType,
) -> XrResult {
    call(instance, "xrEnumerateViewConfigurations", "", |_| {
        values(
            capacity,
            count,
            out,
            &[ViewConfigurationType::PRIMARY_STEREO],
        )
    })
}

pub(super) unsafe extern "system" fn enumerate_blend_modes(
    instance: sys::Instance,
    _system: SystemId,
    _views: ViewConfigurationType,
    capacity: u32,
    count: *mut u32,
    out: *mut EnvironmentBlendMode,
) -> XrResult {
    call(instance, "xrEnumerateEnvironmentBlendModes", "", |world| {
        values(capacity, count, out, &world.blend_modes)
    })
}

pub(super) unsafe extern "system" fn get_view_configuration_properties(
    instance: sys::Instance,
    _system: SystemId,
    views: ViewConfigurationType,
    out: *mut sys::ViewConfigurationProperties,
) -> XrResult {
    call(instance, "xrGetViewConfigurationProperties", "", |_| {
        change(out, |to| {
            to.view_configuration_type = views;
            to.fov_mutable = sys::FALSE;
        })
    })
}

pub(super) unsafe extern "system" fn enumerate_views(
    instance: sys::Instance,
    _system: SystemId,
    _views: ViewConfigurationType,
    capacity: u32,
    count: *mut u32,
    out: *mut sys::ViewConfigurationView,
) -> XrResult {
    call(instance, "xrEnumerateViewConfigurationViews", "", |world| {
        let [width, height] = world.eye_size;
        list(capacity, count, out, &[(); 2], |to, ()| {
            change(to, |to| {
                to.recommended_image_rect_width = width;
                to.max_image_rect_width = 2 * width;
                to.recommended_image_rect_height = height;
                to.max_image_rect_height = 2 * height;
                to.recommended_swapchain_sample_count = 1;
                to.max_swapchain_sample_count = 1;
            });
        })
    })
}

// Sessions.

pub(super) unsafe extern "system" fn create_session(
    instance: sys::Instance,
    info: *const sys::SessionCreateInfo,
    session: *mut sys::Session,
) -> XrResult {
    let next = read(info).next;
    call(instance, "xrCreateSession", describe(next), |world| {
        world.device = match (&world.loader, device::binding(next)) {
            (Some(loader), Some(binding)) => Some(loader.device(&binding)),
            _ => None,
        };
        world.session_lost = false;
        world.session = world.make("session", session);
        (world.running, world.attached, world.begun, world.waited) = (false, false, false, 0);
        world.oblige(&[SessionState::IDLE, SessionState::READY]);
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_session(session: sys::Session) -> XrResult {
    call(session, "xrDestroySession", "", |_| OK)
}

pub(super) unsafe extern "system" fn begin_session(
    session: sys::Session,
    info: *const sys::SessionBeginInfo,
) -> XrResult {
    let views = read(info).primary_view_configuration_type;
    call(session, "xrBeginSession", format!("{views:?}"), |world| {
        if world.running {
            return XrResult::ERROR_SESSION_RUNNING;
        }
        if world.state != SessionState::READY {
            return XrResult::ERROR_SESSION_NOT_READY;
        }
        world.running = true;
        world.oblige(&[
            SessionState::SYNCHRONIZED,
            SessionState::VISIBLE,
            SessionState::FOCUSED,
        ]);
        OK
    })
}

pub(super) unsafe extern "system" fn end_session(session: sys::Session) -> XrResult {
    call(session, "xrEndSession", "", |world| {
        if !world.running {
            return XrResult::ERROR_SESSION_NOT_RUNNING;
        }
        if world.state != SessionState::STOPPING {
            return XrResult::ERROR_SESSION_NOT_STOPPING;
        }
        (world.running, world.begun, world.waited) = (false, false, 0);
        world.oblige(&[SessionState::IDLE, SessionState::EXITING]);
        OK
    })
}

pub(super) unsafe extern "system" fn request_exit(session: sys::Session) -> XrResult {
    call(session, "xrRequestExitSession", "", |world| {
        if !world.running {
            return XrResult::ERROR_SESSION_NOT_RUNNING;
        }
        world.oblige(&[
            SessionState::VISIBLE,
            SessionState::SYNCHRONIZED,
            SessionState::STOPPING,
        ]);
        OK
    })
}

pub(super) unsafe extern "system" fn wait_frame(
    session: sys::Session,
    _info: *const sys::FrameWaitInfo,
    state: *mut sys::FrameState,
) -> XrResult {
    call(session, "xrWaitFrame", "", |world| {
        if !world.running {
            return XrResult::ERROR_SESSION_NOT_RUNNING;
        }
        world.waited += 1;
        world.now_ns += world.period_ns;
        change(state, |to| {
            to.predicted_display_time = Time::from_nanos(world.now_ns);
            to.predicted_display_period = sys::Duration::from_nanos(world.period_ns);
            to.should_render = world.should_render.into();
        })
    })
}

pub(super) unsafe extern "system" fn begin_frame(
    session: sys::Session,
    _info: *const sys::FrameBeginInfo,
) -> XrResult {
    call(session, "xrBeginFrame", "", |world| {
        if !world.running {
            return XrResult::ERROR_SESSION_NOT_RUNNING;
        }
        if world.waited == 0 {
            return XrResult::ERROR_CALL_ORDER_INVALID;
        }
        world.waited -= 1;
        if std::mem::replace(&mut world.begun, true) {
            return XrResult::FRAME_DISCARDED;
        }
        OK
    })
}

pub(super) unsafe extern "system" fn end_frame(
    session: sys::Session,
    info: *const sys::FrameEndInfo,
) -> XrResult {
    let info = read(info);
    let layers = layers(&info);
    let (time, mode) = (info.display_time, info.environment_blend_mode);
    call(session, "xrEndFrame", format!("{layers:?}"), |world| {
        if !world.begun {
            return XrResult::ERROR_CALL_ORDER_INVALID;
        }
        world.begun = false;
        world.frames.push(EndedFrame {
            display_ns: time.as_nanos(),
            blend_mode: mode,
            layers,
        });
        OK
    })
}

// Spaces and views.

pub(super) unsafe extern "system" fn enumerate_reference_spaces(
    session: sys::Session,
    capacity: u32,
    count: *mut u32,
    out: *mut ReferenceSpaceType,
) -> XrResult {
    call(session, "xrEnumerateReferenceSpaces", "", |world| {
        values(capacity, count, out, &world.reference_spaces)
    })
}

pub(super) unsafe extern "system" fn get_bounds(
    session: sys::Session,
    _ty: ReferenceSpaceType,
    _out: *mut openxr::Extent2Df,
) -> XrResult {
    call(session, "xrGetReferenceSpaceBoundsRect", "", |_| {
        XrResult::SPACE_BOUNDS_UNAVAILABLE
    })
}

pub(super) unsafe extern "system" fn create_reference_space(
    session: sys::Session,
    info: *const sys::ReferenceSpaceCreateInfo,
    space: *mut sys::Space,
) -> XrResult {
    let info = read(info);
    let ty = info.reference_space_type;
    let said = format!("{ty:?}");
    call(session, "xrCreateReferenceSpace", said, |world| {
        if !world.reference_spaces.contains(&ty) {
            return XrResult::ERROR_REFERENCE_SPACE_UNSUPPORTED;
        }
        let Some(offset) = rigid(&info.pose_in_reference_space) else {
            return XrResult::ERROR_POSE_INVALID;
        };
        let handle = world.make("space", space);
        world.spaces.insert(handle, (Place::Reference(ty), offset));
        OK
    })
}

pub(super) unsafe extern "system" fn create_action_space(
    session: sys::Session,
    info: *const sys::ActionSpaceCreateInfo,
    space: *mut sys::Space,
) -> XrResult {
    let info = read(info);
    call(session, "xrCreateActionSpace", "", |world| {
        let Some(offset) = rigid(&info.pose_in_action_space) else {
            return XrResult::ERROR_POSE_INVALID;
        };
        let place = Place::Action {
            action: info.action.into_raw(),
            subaction: info.subaction_path.into_raw(),
        };
        let handle = world.make("space", space);
        world.spaces.insert(handle, (place, offset));
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_space(space: sys::Space) -> XrResult {
    call(space, "xrDestroySpace", "", |_| OK)
}

pub(super) unsafe extern "system" fn locate_space(
    space: sys::Space,
    base: sys::Space,
    time: Time,
    location: *mut sys::SpaceLocation,
) -> XrResult {
    call(space, "xrLocateSpace", format!("{time:?}"), |world| {
        let known = world
            .room_from(base.into_raw())
            .zip(world.room_from(space.into_raw()));
        change(location, |to| {
            to.location_flags = SpaceLocationFlags::EMPTY;
            if let Some((room_from_base, room_from_space)) = known {
                to.location_flags = SpaceLocationFlags::ORIENTATION_VALID
                    | SpaceLocationFlags::POSITION_VALID
                    | SpaceLocationFlags::ORIENTATION_TRACKED
                    | SpaceLocationFlags::POSITION_TRACKED;
                to.pose = posef(&(room_from_base.inverse() * room_from_space));
            }
        })
    })
}

pub(super) unsafe extern "system" fn locate_views(
    session: sys::Session,
    info: *const sys::ViewLocateInfo,
    state: *mut sys::ViewState,
    capacity: u32,
    count: *mut u32,
    out: *mut sys::View,
) -> XrResult {
    let info = read(info);
    let said = format!("{:?}", info.display_time);
    call(session, "xrLocateViews", said, |world| {
        let base = world.room_from(info.space.into_raw());
        change(state, |to| {
            to.view_state_flags = match base {
                Some(_) => ViewStateFlags::ORIENTATION_VALID | ViewStateFlags::POSITION_VALID,
                None => ViewStateFlags::EMPTY,
            };
        });
        let base_from_room = base.unwrap_or_default().inverse();
        list(capacity, count, out, &world.eyes, |to, (pose, fov)| {
            change(to, |to| {
                to.pose = posef(&(base_from_room * rigid(pose).unwrap_or_default()));
                to.fov = *fov;
            });
        })
    })
}

// Swapchains.

pub(super) unsafe extern "system" fn enumerate_formats(
    session: sys::Session,
    capacity: u32,
    count: *mut u32,
    out: *mut i64,
) -> XrResult {
    call(session, "xrEnumerateSwapchainFormats", "", |world| {
        values(capacity, count, out, &world.formats)
    })
}

pub(super) unsafe extern "system" fn create_swapchain(
    session: sys::Session,
    info: *const sys::SwapchainCreateInfo,
    swapchain: *mut sys::Swapchain,
) -> XrResult {
    let info = read(info);
    let (width, height, chain) = (info.width, info.height, describe(info.next));
    let said = format!(
        "{width}x{height}x{} format {} {:?}{chain}",
        info.array_size, info.format, info.usage_flags
    );
    call(session, "xrCreateSwapchain", said, |world| {
        if !world.formats.contains(&info.format) {
            return XrResult::ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED;
        }
        let images = world
            .device
            .as_ref()
            .map(|device| device.images(&info, IMAGES));
        let handle = world.make("swapchain", swapchain);
        world.swapchains.insert(
            handle,
            FakeSwapchain {
                width,
                height,
                density_maps: chain.contains("FOVEATION"),
                acquired: 0,
                images,
            },
        );
        OK
    })
}

pub(super) unsafe extern "system" fn destroy_swapchain(swapchain: sys::Swapchain) -> XrResult {
    call(swapchain, "xrDestroySwapchain", "", |world| {
        world.swapchains.remove(&swapchain.into_raw());
        OK
    })
}

pub(super) unsafe extern "system" fn enumerate_images(
    swapchain: sys::Swapchain,
    capacity: u32,
    count: *mut u32,
    out: *mut sys::SwapchainImageBaseHeader,
) -> XrResult {
    let out: *mut sys::SwapchainImageVulkanKHR = out.cast();
    let chain = if capacity > 0 {
        describe(read(out).next)
    } else {
        String::new()
    };
    call(swapchain, "xrEnumerateSwapchainImages", chain, |world| {
        let handle = swapchain.into_raw();
        let Some(it) = world.swapchains.get(&handle) else {
            return XrResult::ERROR_HANDLE_INVALID;
        };
        let numbers: Vec<u32> = (1..=IMAGES).collect();
        list(capacity, count, out, &numbers, |to, number| {
            let image = handle << 8 | u64::from(*number);
            let real = it.images.as_ref();
            let real = real.map(|images| images.handle(*number as usize - 1));
            change(to, |to| to.image = real.unwrap_or(image));
            for (ty, at) in chained(read(to).next) {
                if ty == sys::SwapchainImageFoveationVulkanFB::TYPE && it.density_maps {
                    change(at.cast::<sys::SwapchainImageFoveationVulkanFB>(), |map| {
                        map.image = image | 0x80;
                        (map.width, map.height) = (it.width.div_ceil(32), it.height.div_ceil(32));
                    });
                }
            }
        })
    })
}

pub(super) unsafe extern "system" fn acquire_image(
    swapchain: sys::Swapchain,
    _info: *const sys::SwapchainImageAcquireInfo,
    index: *mut u32,
) -> XrResult {
    call(swapchain, "xrAcquireSwapchainImage", "", |world| {
        let Some(it) = world.swapchains.get_mut(&swapchain.into_raw()) else {
            return XrResult::ERROR_HANDLE_INVALID;
        };
        it.acquired += 1;
        give(index, (it.acquired - 1) % IMAGES)
    })
}

pub(super) unsafe extern "system" fn wait_image(
    swapchain: sys::Swapchain,
    _info: *const sys::SwapchainImageWaitInfo,
) -> XrResult {
    call(swapchain, "xrWaitSwapchainImage", "", |_| OK)
}

pub(super) unsafe extern "system" fn release_image(
    swapchain: sys::Swapchain,
    _info: *const sys::SwapchainImageReleaseInfo,
) -> XrResult {
    call(swapchain, "xrReleaseSwapchainImage", "", |_| OK)
}
