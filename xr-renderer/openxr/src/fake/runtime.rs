//! The core's functions of instances and systems.

use std::ffi::c_char;

use openxr::sys::{self, Result as XrResult};
use openxr::{EnvironmentBlendMode, Path, SystemId, Version, ViewConfigurationType};

use super::pointers::{chained, change, describe, give, list, put_text, read, read_all};
use super::pointers::{text, values};
use super::{SYSTEM, call, call_here};

const OK: XrResult = XrResult::SUCCESS;

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
