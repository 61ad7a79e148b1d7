//! The loader, and the runtime it finds.

use std::path::{Path, PathBuf};

use openxr::sys::Result as XrResult;
use openxr::{Entry, EntryError};

use super::error::XrError;

/// The folder of a Monado that is not installed, which has a loader too.
const PRIVATE: &str = "MON3TR_MONADO";

/// Where a loader lies below that folder, and its name anywhere else.
const LOADER: &str = "libopenxr_loader.so.1";

/// The way to whichever runtime is active.
#[derive(Clone)]
pub struct Runtime {
    entry: Entry,
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

    /// A runtime of other functions, for tests.
    #[must_use]
    pub fn of(entry: Entry) -> Self {
        Self { entry }
    }

    pub(crate) fn entry(&self) -> &Entry {
        &self.entry
    }
}

fn private_loader() -> Option<PathBuf> {
    let folder = std::env::var_os(PRIVATE).filter(|folder| !folder.is_empty())?;
    Some(Path::new(&folder).join(LOADER))
}

fn no_loader(why: &EntryError) -> XrError {
    XrError::NoLoader(why.to_string())
}

/// What the loader's answer to the first questions means.
pub(crate) fn no_runtime(result: XrResult) -> XrError {
    match result {
        // The loader found a runtime, which does not reach its service.
        XrResult::ERROR_RUNTIME_FAILURE | XrResult::ERROR_INITIALIZATION_FAILED => {
            XrError::NoService { result }
        }
        _ => XrError::NoRuntime { result },
    }
}
