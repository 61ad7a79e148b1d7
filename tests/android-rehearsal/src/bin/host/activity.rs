//! `ANativeActivity` and its callbacks, as `android/native_activity.h` lays them out and Android's framework calls them.

use crate::java::Machine;
use crate::shims::Shims;
use android_rehearsal::protocol::{ActivityIndex, Callback, InputFigures, Intent};
use anyhow::{Context, bail};
use jni_sys::{JNIEnv, JavaVM, jobject};
use std::ffi::{CString, c_char, c_int, c_void};
use std::path::Path;
use std::ptr::{null, null_mut};

/// The API level that the activity tells: a Quest's.
const SDK_VERSION: i32 = 32;

type Plain = Option<unsafe extern "C" fn(*mut NativeActivity)>;
type WithPointer = Option<unsafe extern "C" fn(*mut NativeActivity, *mut c_void)>;

/// `ANativeActivityCallbacks`: null until the app fills it in.
#[repr(C)]
#[derive(Debug, Default)]
struct Callbacks {
    start: Plain,
    resume: Plain,
    save_instance_state:
        Option<unsafe extern "C" fn(*mut NativeActivity, *mut usize) -> *mut c_void>,
    pause: Plain,
    stop: Plain,
    destroy: Plain,
    window_focus_changed: Option<unsafe extern "C" fn(*mut NativeActivity, c_int)>,
    native_window_created: WithPointer,
    native_window_resized: WithPointer,
    native_window_redraw_needed: WithPointer,
    native_window_destroyed: WithPointer,
    input_queue_created: WithPointer,
    input_queue_destroyed: WithPointer,
    content_rect_changed: Option<unsafe extern "C" fn(*mut NativeActivity, *const [i32; 4])>,
    configuration_changed: Plain,
    low_memory: Plain,
}

/// `ANativeActivity`.
#[repr(C)]
#[derive(Debug)]
pub(crate) struct NativeActivity {
    callbacks: *mut Callbacks,
    vm: *mut JavaVM,
    env: *mut JNIEnv,
    /// The Java object, not its class.
    object: jobject,
    internal_data_path: *const c_char,
    external_data_path: *const c_char,
    sdk_version: i32,
    /// The app's own.
    instance: *mut c_void,
    asset_manager: *mut c_void,
    obb_path: *const c_char,
}

/// `ANativeActivity_onCreate`.
type OnCreate = unsafe extern "C" fn(*mut NativeActivity, *const c_void, usize);

/// The entry point that Android looks for in an app's library.
pub(crate) const ON_CREATE: &str = "ANativeActivity_onCreate";

/// Folders that Android gives an app.
#[derive(Debug)]
pub(crate) struct Folders {
    internal: CString,
    external: CString,
}

impl Folders {
    pub(crate) fn below(folder: &Path) -> anyhow::Result<Self> {
        let make = |name: &str| -> anyhow::Result<CString> {
            let path = folder.join(name);
            std::fs::create_dir_all(&path)
                .with_context(|| format!("cannot make {}", path.display()))?;
            Ok(CString::new(path.into_os_string().into_encoded_bytes())?)
        };
        Ok(Self {
            internal: make("internal")?,
            external: make("external")?,
        })
    }
}

/// An activity that was created, until it is destroyed.
#[derive(Debug)]
pub(crate) struct Activity {
    native: Box<NativeActivity>,
    callbacks: Box<Callbacks>,
    window: *mut c_void,
    queue: *mut c_void,
}

impl Activity {
    /// Creates one, with an object of the Java machine's, and hands it to the app.
    pub(crate) fn create(
        on_create: OnCreateFunction,
        index: ActivityIndex,
        intent: Intent,
        folders: &Folders,
        machine: &Machine,
    ) -> Self {
        let mut callbacks = Box::<Callbacks>::default();
        let mut native = Box::new(NativeActivity {
            callbacks: &raw mut *callbacks,
            vm: machine.vm(),
            env: machine.env(),
            object: machine.new_activity(index, intent),
            internal_data_path: folders.internal.as_ptr(),
            external_data_path: folders.external.as_ptr(),
            sdk_version: SDK_VERSION,
            instance: null_mut(),
            // Opaque to the app; libandroid.so's shim knows it.
            asset_manager: 0xa55e7 as *mut c_void,
            obb_path: c"/obb".as_ptr(),
        });
        // SAFETY: what the app is given is laid out as its header says, and lives until after `onDestroy`.
        unsafe { (on_create.0)(&raw mut *native, null(), 0) };
        Self {
            native,
            callbacks,
            window: null_mut(),
            queue: null_mut(),
        }
    }

    /// Calls the app back. The activity is gone after [`Callback::Destroy`].
    pub(crate) fn call(&mut self, callback: Callback, shims: &Shims) -> anyhow::Result<()> {
        let activity = &raw mut *self.native;
        let plain = |function: Plain| -> anyhow::Result<()> {
            let function = function.with_context(|| format!("the app has no {callback}"))?;
            // SAFETY: the app put it there for this, and the activity lives.
            unsafe { function(activity) };
            Ok(())
        };
        let with = |function: WithPointer, pointer: *mut c_void| -> anyhow::Result<()> {
            let function = function.with_context(|| format!("the app has no {callback}"))?;
            // SAFETY: the app put it there for this, and activity, window and queue live.
            unsafe { function(activity, pointer) };
            Ok(())
        };
        let all = &self.callbacks;
        match callback {
            Callback::Start => plain(all.start),
            Callback::Resume => plain(all.resume),
            Callback::Pause => plain(all.pause),
            Callback::Stop => plain(all.stop),
            Callback::Destroy => plain(all.destroy),
            Callback::ConfigurationChanged => plain(all.configuration_changed),
            Callback::LowMemory => plain(all.low_memory),
            Callback::FocusGained | Callback::FocusLost => {
                let function = all.window_focus_changed.context("no focus callback")?;
                // SAFETY: as above.
                unsafe { function(activity, c_int::from(callback == Callback::FocusGained)) };
                Ok(())
            }
            Callback::SaveInstanceState => {
                let function = all.save_instance_state.context("no callback for saving")?;
                let mut size = 0;
                // SAFETY: as above. What it returns is malloc's.
                unsafe { libc::free(function(activity, &raw mut size)) };
                Ok(())
            }
            Callback::NativeWindowCreated => {
                self.window = shims.new_window();
                with(all.native_window_created, self.window)?;
                with(all.native_window_resized, self.window)?;
                let rect = [0, 0, 1024, 640];
                if let Some(function) = all.content_rect_changed {
                    // SAFETY: as above; the rectangle is read during the call.
                    unsafe { function(activity, &raw const rect) };
                }
                with(all.native_window_redraw_needed, self.window)
            }
            Callback::NativeWindowResized => with(all.native_window_resized, self.window),
            Callback::NativeWindowDestroyed => {
                with(all.native_window_destroyed, self.window)?;
                shims.free_window(&mut self.window);
                Ok(())
            }
            Callback::InputQueueCreated => {
                self.queue = shims.new_queue();
                with(all.input_queue_created, self.queue)
            }
            Callback::InputQueueDestroyed => {
                with(all.input_queue_destroyed, self.queue)?;
                shims.free_queue(&mut self.queue);
                Ok(())
            }
        }
    }

    /// The activity's Java object.
    pub(crate) fn object(&self) -> jobject {
        self.native.object
    }

    /// Puts events into its queue.
    pub(crate) fn put_input(&self, shims: &Shims, events: u32) -> anyhow::Result<()> {
        if self.queue.is_null() {
            bail!("the activity has no input queue");
        }
        shims.put_input(self.queue, events);
        Ok(())
    }

    /// How many were taken and finished.
    pub(crate) fn input_figures(&self, shims: &Shims) -> InputFigures {
        shims.input_figures(self.queue)
    }
}

/// The Java object of an activity that the app hands back.
///
/// # Safety
/// `activity` is what the app was created with, and not destroyed.
pub(crate) unsafe fn object_of(activity: *mut c_void) -> jobject {
    // SAFETY: as the caller says.
    unsafe { (*activity.cast::<NativeActivity>()).object }
}

/// The app's entry point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OnCreateFunction(OnCreate);

impl OnCreateFunction {
    /// The entry point in the app's library.
    pub(crate) fn of(library: &libloading::os::unix::Library) -> anyhow::Result<Self> {
        // SAFETY: this is the signature that Android calls it by.
        let found = unsafe { library.get::<OnCreate>(ON_CREATE) };
        let found = found.with_context(|| format!("the library has no {ON_CREATE}"))?;
        Ok(Self(*found))
    }
}
