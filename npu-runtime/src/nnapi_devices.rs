//! What Android's NNAPI can compute on.
//!
//! ONNX Runtime leaves NNAPI's devices of the kind CPU out when it is told to. Where no other is left it compiles for "any device" all the same, which is
//! Android's reference code on the CPU, and reports every node as taken. So what devices there are is asked here, before NNAPI is offered.

use std::ffi::{CStr, c_char, c_int, c_void};

/// Part of every Android from 8.1 on; its devices can be asked for from 10 on.
#[cfg(target_os = "android")]
const LIBRARY: &str = "libneuralnetworks.so";
/// No more are asked for: phones have a handful.
const MOST_DEVICES: u32 = 64;

/// `DeviceTypeCode` of Android's `NeuralNetworks.h`.
const CPU: i32 = 2;
const NO_ERROR: c_int = 0;

type GetCount = unsafe extern "C" fn(*mut u32) -> c_int;
type GetDevice = unsafe extern "C" fn(u32, *mut *mut c_void) -> c_int;
type GetType = unsafe extern "C" fn(*const c_void, *mut i32) -> c_int;
type GetName = unsafe extern "C" fn(*const c_void, *mut *const c_char) -> c_int;

/// A device as its driver describes it.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Device {
    name: String,
    kind: i32,
}

/// Why NNAPI would not compute on anything but the CPU here; nothing if it would.
#[cfg(target_os = "android")]
pub(crate) fn lacks_accelerator() -> Option<String> {
    match devices(LIBRARY) {
        Ok(devices) => without_accelerator(&devices),
        Err(why) => Some(format!(
            "what NNAPI computes on cannot be asked for, which takes Android 10 ({why})"
        )),
    }
}

fn without_accelerator(devices: &[Device]) -> Option<String> {
    if devices.iter().any(|device| device.kind != CPU) {
        return None;
    }
    let names: Vec<&str> = devices.iter().map(|device| device.name.as_str()).collect();
    Some(match names.as_slice() {
        [] => "NNAPI has no device here".to_owned(),
        names => format!(
            "NNAPI computes on the CPU alone here ({}), for which ONNX Runtime's own code is faster",
            names.join(", ")
        ),
    })
}

fn devices(library: &str) -> Result<Vec<Device>, String> {
    let text = |why: libloading::Error| match std::error::Error::source(&why) {
        Some(cause) => format!("{library}: {cause}"),
        None => format!("{library}: {why}"),
    };
    // SAFETY: the system's library has no constructors that ask for anything of its loader.
    let loaded = unsafe { libloading::Library::new(library) }.map_err(text)?;
    // SAFETY: the four functions have these types in Android's NeuralNetworks.h, and are called while the library is loaded.
    unsafe {
        let count = loaded
            .get::<GetCount>(c"ANeuralNetworks_getDeviceCount")
            .map_err(text)?;
        let device = loaded
            .get::<GetDevice>(c"ANeuralNetworks_getDevice")
            .map_err(text)?;
        let kind = loaded
            .get::<GetType>(c"ANeuralNetworksDevice_getType")
            .map_err(text)?;
        let name = loaded
            .get::<GetName>(c"ANeuralNetworksDevice_getName")
            .map_err(text)?;
        let mut found = Vec::new();
        let mut devices = 0;
        check("ANeuralNetworks_getDeviceCount", count(&raw mut devices))?;
        for index in 0..devices.min(MOST_DEVICES) {
            let mut handle = std::ptr::null_mut();
            check("ANeuralNetworks_getDevice", device(index, &raw mut handle))?;
            let (mut its_kind, mut its_name) = (0, std::ptr::null());
            check(
                "ANeuralNetworksDevice_getType",
                kind(handle, &raw mut its_kind),
            )?;
            check(
                "ANeuralNetworksDevice_getName",
                name(handle, &raw mut its_name),
            )?;
            let its_name = if its_name.is_null() {
                String::new()
            } else {
                // The driver's text lives as long as the library.
                CStr::from_ptr(its_name).to_string_lossy().into_owned()
            };
            found.push(Device {
                name: its_name,
                kind: its_kind,
            });
        }
        Ok(found)
    }
}

fn check(what: &str, status: c_int) -> Result<(), String> {
    match status {
        NO_ERROR => Ok(()),
        other => Err(format!("{what} fails with {other}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(name: &str, kind: i32) -> Device {
        Device {
            name: name.to_owned(),
            kind,
        }
    }

    #[test]
    fn only_another_device_than_a_cpu_is_an_accelerator() {
        let reference = device("nnapi-reference", CPU);
        for (others, lacks) in [
            (vec![], true),
            (vec![reference.clone()], true),
            // Kinds other, GPU, accelerator, and one that the driver does not tell.
            (vec![reference.clone(), device("qti-hta", 4)], false),
            (vec![device("qti-gpu", 3), reference.clone()], false),
            (vec![device("unknown", 0)], false),
        ] {
            let why = without_accelerator(&others);
            assert_eq!(why.is_some(), lacks, "{others:?}: {why:?}");
        }
        let why = without_accelerator(&[reference]).expect("a CPU alone");
        assert!(why.contains("nnapi-reference"), "{why}");
    }

    #[test]
    fn a_system_without_the_library_or_its_functions_says_so() {
        let why = devices("libno-such-library.so").expect_err("none");
        assert!(why.contains("libno-such-library.so"), "{why}");
        // Loaded already, and without these functions.
        let why = devices("libc.so.6").expect_err("another library");
        assert!(why.contains("ANeuralNetworks_getDeviceCount"), "{why}");
    }
}
