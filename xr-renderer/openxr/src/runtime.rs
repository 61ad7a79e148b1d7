//! The loader, and the runtime it finds. On a headset's own Android both need the activity that they work for.

#[cfg(not(target_os = "android"))]
use std::path::{Path, PathBuf};

use openxr::sys::Result as XrResult;
use openxr::{ApplicationInfo, Entry, EntryError, ExtensionSet, Instance};

use crate::error::XrError;

/// The folder of a private Monado, which has a loader too.
#[cfg(not(target_os = "android"))]
const PRIVATE: &str = "MON3TR_MONADO";

/// Where a loader lies below that folder, and its name anywhere else.
#[cfg(not(target_os = "android"))]
const LOADER: &str = "libopenxr_loader.so.1";

/// The loader, through which the active runtime is reached.
#[derive(Clone)]
pub struct Runtime {
    entry: Entry,
    #[cfg(target_os = "android")]
    activity: Option<Activity>,
}

/// The `JavaVM` and the activity that shows the session, as addresses: the caller of [`Runtime::load_android`] guarantees them.
#[cfg(target_os = "android")]
#[derive(Clone, Copy)]
struct Activity {
    vm: usize,
    activity: usize,
}

#[cfg(target_os = "android")]
impl Activity {
    fn platform(self) -> openxr::AndroidPlatformInfo {
        // SAFETY: the caller of `Runtime::load_android` guarantees that both are valid as long as there is a runtime.
        unsafe { openxr::AndroidPlatformInfo::new(self.vm as *mut _, self.activity as *mut _) }
    }
}

impl std::fmt::Debug for Runtime {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Runtime").finish_non_exhaustive()
    }
}

impl Runtime {
    /// Loads the machine's loader, else the one that lies with a private Monado (`MON3TR_MONADO`).
    ///
    /// # Errors
    /// [`XrError::NoLoader`].
    #[cfg(not(target_os = "android"))]
    pub fn load() -> Result<Self, XrError> {
        // SAFETY: a loader by that name is what it claims to be; loading it runs its initialisers.
        let own = unsafe { Entry::load(&()) };
        let entry = match (own, private_loader()) {
            (Ok(entry), _) => entry,
            (Err(why), None) => return Err(no_loader(&why)),
            (Err(_), Some(path)) => {
                // SAFETY: as above.
                unsafe { Entry::load_from(&path, &()) }.map_err(|why| no_loader(&why))?
            }
        };
        Ok(Self { entry })
    }

    /// Loads the loader in the application's own package, and passes it the activity that will be shown.
    ///
    /// # Errors
    /// [`XrError::NoLoader`], if the package has none, or the loader refuses the activity.
    ///
    /// # Safety
    /// `vm` is the process's `JavaVM`, and `activity` a global reference to its `android.app.Activity`, as
    /// `android_activity::AndroidApp` has them (`vm_as_ptr`, `activity_as_ptr`); both outlive the runtime and all its copies.
    #[cfg(target_os = "android")]
    pub unsafe fn load_android(
        vm: *mut std::ffi::c_void,
        activity: *mut std::ffi::c_void,
    ) -> Result<Self, XrError> {
        let activity = Activity {
            vm: vm as usize,
            activity: activity as usize,
        };
        // SAFETY: the package's own loader is what it claims to be; loading it runs its initialisers.
        let entry = unsafe { Entry::load(&activity.platform()) }.map_err(|why| no_loader(&why))?;
        Ok(Self {
            entry,
            activity: Some(activity),
        })
    }

    /// A runtime behind another function table, for tests.
    #[must_use]
    pub fn of(entry: Entry) -> Self {
        Self {
            entry,
            #[cfg(target_os = "android")]
            activity: None,
        }
    }

    /// Starts the runtime for an application.
    pub(crate) fn instance(
        &self,
        application: &ApplicationInfo<'_>,
        extensions: &ExtensionSet,
    ) -> Result<Instance, XrResult> {
        #[cfg(target_os = "android")]
        if let Some(activity) = self.activity {
            return self
                .entry
                .create_instance(application, extensions, &[], &activity.platform());
        }
        self.entry
            .create_instance(application, extensions, &[], &())
    }

    pub(crate) fn entry(&self) -> &Entry {
        &self.entry
    }
}

#[cfg(not(target_os = "android"))]
fn private_loader() -> Option<PathBuf> {
    let folder = std::env::var_os(PRIVATE).filter(|folder| !folder.is_empty())?;
    Some(Path::new(&folder).join(LOADER))
}

fn no_loader(why: &EntryError) -> XrError {
    XrError::NoLoader(why.to_string())
}

/// The error that the loader's first result means.
pub(crate) fn no_runtime(result: XrResult) -> XrError {
    match result {
        // The loader found a runtime that cannot reach its service.
        XrResult::ERROR_RUNTIME_FAILURE | XrResult::ERROR_INITIALIZATION_FAILED => {
            XrError::NoService { result }
        }
        _ => XrError::NoRuntime { result },
    }
}
