//! The host's calls into the shims of `libandroid.so` and `libopenxr_loader.so`, beside the app's own (`shims/`).

use android_rehearsal::protocol::{FrameFigures, InputFigures, PowerFigures};
use anyhow::Context;
use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
use std::ffi::{c_int, c_void};

/// The shims, loaded.
#[derive(Debug)]
pub(crate) struct Shims {
    new_window: unsafe extern "C" fn() -> *mut c_void,
    free_window: unsafe extern "C" fn(*mut c_void),
    window_references: unsafe extern "C" fn() -> c_int,
    new_queue: unsafe extern "C" fn() -> *mut c_void,
    free_queue: unsafe extern "C" fn(*mut c_void),
    put_input: unsafe extern "C" fn(*mut c_void, c_int),
    input_figures: unsafe extern "C" fn(*mut c_void, *mut InputFigures),
    frames: unsafe extern "C" fn(*mut FrameFigures),
    power: unsafe extern "C" fn(*mut PowerFigures),
}

impl Shims {
    /// Loads them by the names that the app knows them by; `on_finish` is called where the app calls `ANativeActivity_finish`.
    pub(crate) fn load(on_finish: unsafe extern "C" fn(*mut c_void)) -> anyhow::Result<Self> {
        let (android, open_xr) = (load("libandroid.so")?, load("libopenxr_loader.so")?);
        macro_rules! function {
            ($library:ident, $name:literal) => {
                // SAFETY: the shims declare it so, and they are never unloaded.
                *unsafe { $library.get($name) }.context($name)?
            };
        }
        let set_on_finish: unsafe extern "C" fn(unsafe extern "C" fn(*mut c_void)) =
            function!(android, "rehearsal_on_finish");
        let shims = Self {
            new_window: function!(android, "rehearsal_new_window"),
            window_references: function!(android, "rehearsal_window_references"),
            free_window: function!(android, "rehearsal_free_window"),
            free_queue: function!(android, "rehearsal_free_queue"),
            new_queue: function!(android, "rehearsal_new_queue"),
            put_input: function!(android, "rehearsal_put_input"),
            input_figures: function!(android, "rehearsal_input_figures"),
            frames: function!(open_xr, "rehearsal_frames"),
            power: function!(android, "rehearsal_power"),
        };
        // SAFETY: the function lives as long as the process.
        unsafe { set_on_finish(on_finish) };
        std::mem::forget((android, open_xr));
        Ok(shims)
    }

    /// Frames handed to the compositor so far.
    pub(crate) fn frames(&self) -> FrameFigures {
        let mut figures = FrameFigures::default();
        // SAFETY: the figures are laid out as there.
        unsafe { (self.frames)(&raw mut figures) };
        figures
    }

    /// What was done with heat and performance hints so far.
    pub(crate) fn power(&self) -> PowerFigures {
        let mut figures = PowerFigures::default();
        // SAFETY: the figures are laid out as there.
        unsafe { (self.power)(&raw mut figures) };
        figures
    }

    pub(crate) fn new_window(&self) -> *mut c_void {
        // SAFETY: takes nothing.
        unsafe { (self.new_window)() }
    }

    /// Frees a window after the app got the event of its destruction; leaves null in its place.
    pub(crate) fn free_window(&self, window: &mut *mut c_void) {
        let window = std::mem::replace(window, std::ptr::null_mut());
        // SAFETY: `new_window` made it, or it is null. The app has released it: the framework frees it.
        unsafe { (self.free_window)(window) };
    }

    /// Frees a queue after the app got the event of its destruction; leaves null in its place.
    pub(crate) fn free_queue(&self, queue: &mut *mut c_void) {
        let queue = std::mem::replace(queue, std::ptr::null_mut());
        if !queue.is_null() {
            // SAFETY: `new_queue` made it, and the app has detached its looper from it.
            unsafe { (self.free_queue)(queue) };
        }
    }

    /// References to windows beside the framework's own.
    pub(crate) fn window_references(&self) -> i32 {
        // SAFETY: takes nothing.
        unsafe { (self.window_references)() }
    }

    pub(crate) fn new_queue(&self) -> *mut c_void {
        // SAFETY: takes nothing.
        unsafe { (self.new_queue)() }
    }

    pub(crate) fn put_input(&self, queue: *mut c_void, events: u32) {
        let events = c_int::try_from(events).unwrap_or(c_int::MAX);
        // SAFETY: a queue that `new_queue` made and that was not freed.
        unsafe { (self.put_input)(queue, events) };
    }

    pub(crate) fn input_figures(&self, queue: *mut c_void) -> InputFigures {
        let mut figures = InputFigures::default();
        if !queue.is_null() {
            // SAFETY: as above; the figures are laid out as there.
            unsafe { (self.input_figures)(queue, &raw mut figures) };
        }
        figures
    }
}

fn load(name: &str) -> anyhow::Result<Library> {
    // SAFETY: the initialisers of shims make a key for thread-local values and open another library, and nothing else.
    let library = unsafe { Library::open(Some(name), RTLD_NOW | RTLD_LOCAL) };
    library.with_context(|| format!("the shim of {name} cannot be loaded"))
}
