//! The functions as Android's `thermal.h` and `performance_hint.h` declare them.

use std::ffi::{c_float, c_int, c_void};

/// The library that has them.
#[cfg(any(target_os = "android", test))]
pub(crate) const LIBRARY: &str = "libandroid.so";

/// An opaque object of the platform: `AThermalManager`, `APerformanceHintManager` or `APerformanceHintSession`.
pub(crate) type Object = *mut c_void;
/// `AThermal_StatusCallback`: what it was registered with, and an `AThermalStatus`.
pub(crate) type StatusCallback = unsafe extern "C" fn(*mut c_void, c_int);

/// Of API level 30.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ThermalFunctions {
    pub(crate) acquire_manager: unsafe extern "C" fn() -> Object,
    pub(crate) release_manager: unsafe extern "C" fn(Object),
    pub(crate) current_status: unsafe extern "C" fn(Object) -> c_int,
    pub(crate) register: unsafe extern "C" fn(Object, StatusCallback, *mut c_void) -> c_int,
    pub(crate) unregister: unsafe extern "C" fn(Object, StatusCallback, *mut c_void) -> c_int,
    /// Of API level 31: by how many seconds ahead.
    pub(crate) headroom: Option<unsafe extern "C" fn(Object, c_int) -> c_float>,
}

/// Of API level 33. Times are nanoseconds.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HintFunctions {
    pub(crate) manager: unsafe extern "C" fn() -> Object,
    pub(crate) create_session: unsafe extern "C" fn(Object, *const i32, usize, i64) -> Object,
    pub(crate) update_target: unsafe extern "C" fn(Object, i64) -> c_int,
    pub(crate) report_actual: unsafe extern "C" fn(Object, i64) -> c_int,
    pub(crate) close_session: unsafe extern "C" fn(Object),
}
