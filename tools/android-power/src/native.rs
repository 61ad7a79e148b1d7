//! The platform's functions looked up and called: all that is unsafe here.

use std::ffi::{c_int, c_void};
use std::ptr::NonNull;
use std::time::Duration;

use crate::shape::{HintFunctions, Object, StatusCallback, ThermalFunctions};

/// What the platform has of thermal and performance functions.
#[derive(Debug, Clone, Copy, Default)]
pub struct System {
    pub(crate) thermal: Option<ThermalFunctions>,
    pub(crate) hints: Option<HintFunctions>,
}

impl System {
    /// Of the system that this program runs on.
    #[cfg(target_os = "android")]
    #[must_use]
    pub fn here() -> Self {
        static HERE: std::sync::OnceLock<System> = std::sync::OnceLock::new();
        *HERE.get_or_init(|| {
            let found = Self::load(crate::shape::LIBRARY);
            let state = |there: bool| if there { "there" } else { "not there" };
            log::debug!(
                "Android's functions: thermal status {}, thermal headroom {}, performance hints {}",
                state(found.thermal.is_some()),
                state(found.thermal.is_some_and(|it| it.headroom.is_some())),
                state(found.hints.is_some()),
            );
            found
        })
    }

    /// Of the system that this program runs on, which is not Android and has none.
    #[cfg(not(target_os = "android"))]
    #[must_use]
    pub fn here() -> Self {
        Self::default()
    }

    /// What a library has of them, which stays loaded.
    #[cfg(any(target_os = "android", test))]
    pub(crate) fn load(library: &str) -> Self {
        // SAFETY: the system's library has no constructors that ask for anything of its loader.
        let loaded = match unsafe { libloading::Library::new(library) } {
            Ok(loaded) => loaded,
            Err(why) => {
                log::debug!("no {library}: {why}");
                return Self::default();
            }
        };
        // For good: the functions are called as long as the program runs, and the system's library is part of every app anyway.
        let library = Box::leak(Box::new(loaded));
        Self {
            thermal: thermal_functions(library),
            hints: hint_functions(library),
        }
    }
}

#[cfg(any(target_os = "android", test))]
fn thermal_functions(library: &libloading::Library) -> Option<ThermalFunctions> {
    // SAFETY: each has the type of its name's declaration in Android's thermal.h.
    unsafe {
        Some(ThermalFunctions {
            acquire_manager: *library.get(c"AThermal_acquireManager").ok()?,
            release_manager: *library.get(c"AThermal_releaseManager").ok()?,
            current_status: *library.get(c"AThermal_getCurrentThermalStatus").ok()?,
            register: *library
                .get(c"AThermal_registerThermalStatusListener")
                .ok()?,
            unregister: *library
                .get(c"AThermal_unregisterThermalStatusListener")
                .ok()?,
            headroom: (library.get(c"AThermal_getThermalHeadroom").ok()).map(|function| *function),
        })
    }
}

#[cfg(any(target_os = "android", test))]
fn hint_functions(library: &libloading::Library) -> Option<HintFunctions> {
    // SAFETY: each has the type of its name's declaration in Android's performance_hint.h.
    unsafe {
        Some(HintFunctions {
            manager: *library.get(c"APerformanceHint_getManager").ok()?,
            create_session: *library.get(c"APerformanceHint_createSession").ok()?,
            update_target: *library
                .get(c"APerformanceHint_updateTargetWorkDuration")
                .ok()?,
            report_actual: *library
                .get(c"APerformanceHint_reportActualWorkDuration")
                .ok()?,
            close_session: *library.get(c"APerformanceHint_closeSession").ok()?,
        })
    }
}

/// An `AThermalManager`, released when it is dropped.
#[derive(Debug)]
pub(crate) struct ThermalManager {
    functions: ThermalFunctions,
    object: NonNull<c_void>,
    /// Where it is registered.
    listener: Option<StatusCallback>,
}

/// Is told of an `AThermalStatus`, on a thread of the platform's.
pub(crate) trait Listener {
    fn changed(status: c_int);
}

// SAFETY: the manager is not bound to a thread, and locks itself.
unsafe impl Send for ThermalManager {}

impl ThermalManager {
    /// None where the platform gives none.
    pub(crate) fn acquire(functions: ThermalFunctions) -> Option<Self> {
        // SAFETY: it takes nothing.
        let object = unsafe { (functions.acquire_manager)() };
        Some(Self {
            functions,
            object: NonNull::new(object)?,
            listener: None,
        })
    }

    /// An `AThermalStatus`.
    pub(crate) fn status(&self) -> c_int {
        // SAFETY: the manager is alive.
        unsafe { (self.functions.current_status)(self.object.as_ptr()) }
    }

    /// As the platform gives it: not a number where it does not know. None where it has no function for it.
    pub(crate) fn headroom(&self, seconds_ahead: c_int) -> Option<f32> {
        let headroom = self.functions.headroom?;
        // SAFETY: the manager is alive.
        Some(unsafe { headroom(self.object.as_ptr(), seconds_ahead) })
    }

    /// Has changes of the status told, once. Whether the platform does so.
    pub(crate) fn listen<L: Listener>(&mut self) -> bool {
        let callback: StatusCallback = on_status::<L>;
        let (object, functions) = (self.object.as_ptr(), self.functions);
        // SAFETY: the manager is alive; the callback reads nothing through the pointer, which is null, and is there as long as the program.
        let failed = unsafe { (functions.register)(object, callback, std::ptr::null_mut()) };
        self.listener = (failed == 0).then_some(callback);
        self.listener.is_some()
    }
}

impl Drop for ThermalManager {
    fn drop(&mut self) {
        let (object, functions) = (self.object.as_ptr(), self.functions);
        // SAFETY: the manager is alive, and not used any more; what is not listened to any more was registered by the same arguments.
        unsafe {
            if let Some(callback) = self.listener {
                (functions.unregister)(object, callback, std::ptr::null_mut());
            }
            (functions.release_manager)(object);
        }
    }
}

/// Called by the platform.
extern "C" fn on_status<L: Listener>(_: *mut c_void, status: c_int) {
    L::changed(status);
}

/// An `APerformanceHintSession`, closed when it is dropped. It is used by one thread at a time.
#[derive(Debug)]
pub(crate) struct Session {
    functions: HintFunctions,
    object: NonNull<c_void>,
}

// SAFETY: a session is not bound to the thread that made it, and whoever holds it alone uses it.
unsafe impl Send for Session {}

impl Session {
    /// For these threads of this process, by the kernel's numbers, which are to have their work done within `target`. None where
    /// the platform gives none.
    pub(crate) fn create(
        functions: HintFunctions,
        threads: &[i32],
        target: Duration,
    ) -> Option<Self> {
        // SAFETY: it takes nothing.
        let manager: Object = unsafe { (functions.manager)() };
        let manager = NonNull::new(manager)?.as_ptr();
        let (first, count) = (threads.as_ptr(), threads.len());
        // SAFETY: the manager is the platform's and lives as long as the process; there are as many numbers as it is told.
        let made =
            unsafe { (functions.create_session)(manager, first, count, nanoseconds(target)) };
        Some(Self {
            functions,
            object: NonNull::new(made)?,
        })
    }

    /// The platform's error, if it has one.
    pub(crate) fn update_target(&self, target: Duration) -> Result<(), c_int> {
        // SAFETY: the session is open.
        result(unsafe { (self.functions.update_target)(self.object.as_ptr(), nanoseconds(target)) })
    }

    /// The platform's error, if it has one.
    pub(crate) fn report_actual(&self, worked: Duration) -> Result<(), c_int> {
        // SAFETY: the session is open.
        result(unsafe { (self.functions.report_actual)(self.object.as_ptr(), nanoseconds(worked)) })
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // SAFETY: the session is open, and not used any more.
        unsafe { (self.functions.close_session)(self.object.as_ptr()) };
    }
}

fn result(errno: c_int) -> Result<(), c_int> {
    if errno == 0 { Ok(()) } else { Err(errno) }
}

/// At least one, for the platform takes no less.
fn nanoseconds(time: Duration) -> i64 {
    i64::try_from(time.as_nanos()).unwrap_or(i64::MAX).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::LIBRARY;

    #[test]
    fn a_system_without_the_library_or_its_functions_has_none() {
        let here = System::here();
        for system in [System::load(LIBRARY), System::load("libc.so.6"), here] {
            assert!(system.thermal.is_none(), "{system:?}");
            assert!(system.hints.is_none(), "{system:?}");
        }
    }
}
