//! Loading the ONNX Runtime library and its one environment per process.

use crate::devices::is_built_in;
use crate::landing::forward_to_log;
use crate::qnn::Plugin;
use crate::{Cancel, ProviderKind, RuntimeError};
use ort::environment::Environment;
use ort::logging::LogLevel;
use serde::Serialize;
use std::ffi::CStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// The loaded ONNX Runtime. Cheap to clone; a process has one.
#[derive(Debug, Clone)]
pub struct Runtime {
    pub(crate) environment: Environment,
    library: PathBuf,
    version: String,
    qnn: Arc<OnceLock<Result<Plugin, String>>>,
    pub(crate) cancel: Cancel,
}

/// Whether a provider is available here.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Availability {
    /// Which one.
    pub provider: ProviderKind,
    /// Why not, in words; nothing if it can.
    pub lacking: Option<String>,
    /// The library that has it, a path.
    pub library: PathBuf,
}

impl fmt::Display for Availability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.lacking {
            None => write!(f, "{}: from {}", self.provider, self.library.display()),
            Some(why) => write!(f, "{}: no, {why}", self.provider),
        }
    }
}

/// ONNX Runtime allows one environment per process; the first caller makes it.
static LOADED: Mutex<Option<Runtime>> = Mutex::new(None);

impl Runtime {
    /// Loads ONNX Runtime from `library`, else from `ORT_DYLIB_PATH`, else by its name from the system's search path.
    /// A second call returns the runtime that is already loaded.
    ///
    /// # Errors
    /// [`RuntimeError::Library`] if there is none or it is older than 1.24.
    pub fn open(library: Option<&Path>) -> Result<Self, RuntimeError> {
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = loaded.as_ref() {
            return Ok(runtime.clone());
        }
        let library = library.map_or_else(default_library, Path::to_path_buf);
        let fail = |reason: String| RuntimeError::Library {
            path: library.clone(),
            reason,
        };
        let environment = ort::init_from(&library)
            .map_err(|e| fail(e.to_string()))?
            .with_name("mon3tr")
            .with_telemetry(false)
            .with_logger(Arc::new(
                |level, _: &str, _: &str, location: &str, message: &str| {
                    forward_to_log(level, location, message);
                },
            ))
            .build()
            .map_err(|e| fail(e.to_string()))?;
        // ONNX Runtime is not to format lines that no logger takes, in every run.
        environment.set_log_level(if log::log_enabled!(log::Level::Trace) {
            LogLevel::Verbose
        } else {
            LogLevel::Warning
        });
        let runtime = Self {
            environment,
            version: version_of(&library),
            library,
            qnn: Arc::default(),
            cancel: Cancel::default(),
        };
        log::debug!(
            "ONNX Runtime {} from {}",
            runtime.version,
            runtime.library.display()
        );
        *loaded = Some(runtime.clone());
        Ok(runtime)
    }

    /// The same runtime, with loads that `cancel` can end.
    #[must_use]
    pub fn cancelled_by(&self, cancel: &Cancel) -> Self {
        Self {
            cancel: cancel.clone(),
            ..self.clone()
        }
    }

    /// The library this runtime came from.
    #[must_use]
    pub fn library(&self) -> &Path {
        &self.library
    }

    /// Its version, e.g. `1.31.1`.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Which providers are available, most preferred first: QNN, NNAPI, XNNPACK, CPU. The first call loads QNN's plugin.
    #[must_use]
    pub fn probe(&self) -> Vec<Availability> {
        let probe = |provider| Availability {
            provider,
            lacking: self.lacks(provider),
            library: match (provider, self.qnn.get()) {
                (ProviderKind::Qnn, Some(Ok(plugin))) => plugin.library().to_path_buf(),
                _ => self.library.clone(),
            },
        };
        ProviderKind::ALL.map(probe).into()
    }

    /// Why `provider` is not available; nothing if it is.
    pub(crate) fn lacks(&self, provider: ProviderKind) -> Option<String> {
        if provider == ProviderKind::Qnn {
            return self.qnn().err().map(str::to_owned);
        }
        if is_built_in(provider) {
            #[cfg(target_os = "android")]
            if provider == ProviderKind::Nnapi {
                return crate::nnapi_devices::lacks_accelerator();
            }
            return None;
        }
        if provider == ProviderKind::Nnapi && !cfg!(target_os = "android") {
            return Some("it is part of Android, and this is another system".into());
        }
        Some(format!(
            "the ONNX Runtime {} at {} was built without it",
            self.version,
            self.library.display()
        ))
    }

    /// QNN's plugin, registered once; else why not.
    pub(crate) fn qnn(&self) -> Result<&Plugin, &str> {
        self.qnn
            .get_or_init(|| Plugin::register(&self.environment, &self.library))
            .as_ref()
            .map_err(String::as_str)
    }

    /// A hash over QNN's plugin and the libraries beside it, to tell versions apart; nothing without the plugin.
    #[must_use]
    pub fn qnn_fingerprint(&self) -> Option<&str> {
        self.qnn().ok().map(Plugin::fingerprint)
    }
}

fn default_library() -> PathBuf {
    match std::env::var_os("ORT_DYLIB_PATH") {
        Some(path) if !path.is_empty() => path.into(),
        _ => format!(
            "{}onnxruntime{}",
            std::env::consts::DLL_PREFIX,
            std::env::consts::DLL_SUFFIX
        )
        .into(),
    }
}

/// As the library itself says; where that cannot be asked, from its build string, which names a branch `rel-1.31.1` in most official
/// builds, or its file's own name.
fn version_of(library: &Path) -> String {
    let said = said_version(library);
    if let Err(why) = &said {
        log::debug!("{} is not asked for its version: {why}", library.display());
    }
    said.unwrap_or_else(|_| version_from(ort::info(), library))
}

/// `OrtGetApiBase()->GetVersionString()`, which ort asks too and does not pass on.
fn said_version(library: &Path) -> Result<String, String> {
    type GetApiBase = unsafe extern "C" fn() -> *const ort::sys::OrtApiBase;
    #[cfg(unix)]
    let opened = {
        use libloading::os::unix::{Library, RTLD_LAZY};
        /// Of Linux and Android: only what is loaded already.
        const RTLD_NOLOAD: std::ffi::c_int = 4;
        // SAFETY: this is the library that ort has loaded already, or an error: no initialiser runs.
        unsafe { Library::open(Some(library), RTLD_LAZY | RTLD_NOLOAD) }
    };
    #[cfg(not(unix))]
    // SAFETY: by its full path this is the library that ort has loaded already: no initialiser runs.
    let opened = unsafe { libloading::Library::new(library) };
    let library = opened.map_err(|why| why.to_string())?;
    // SAFETY: this is the function's type in ONNX Runtime's C interface.
    let base = unsafe { library.get::<GetApiBase>(b"OrtGetApiBase") };
    let base = base.map_err(|why| why.to_string())?;
    // SAFETY: it has no conditions; what it gives is static, as is the version.
    let version = unsafe {
        let base = base().as_ref().ok_or("it has no interface")?;
        CStr::from_ptr((base.GetVersionString)())
    };
    Ok(version.to_string_lossy().into_owned())
}

/// The version in a build string, else in a file's name.
fn version_from(build_info: &str, library: &Path) -> String {
    let branch = build_info
        .split(['=', ',', ' '])
        .find_map(|word| word.strip_prefix("rel-"));
    let resolved = std::fs::canonicalize(library).unwrap_or_else(|_| library.to_path_buf());
    let file = resolved
        .file_name()
        .and_then(|name| name.to_str())
        .and_then(|name| name.split_once(".so."));
    file.map(|(_, version)| version)
        .or(branch)
        .unwrap_or("unknown")
        .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_is_asked_for_its_version() {
        let library = match Runtime::open(None) {
            Ok(runtime) => runtime.library().to_path_buf(),
            Err(why) => {
                let must = std::env::var("CI").as_deref() == Ok("true");
                assert!(!must, "CI must have ONNX Runtime: {why}");
                println!("skipped: {why}");
                return;
            }
        };
        let version = said_version(&library).expect("it answers");
        let numbers: Vec<u32> = version.split('.').flat_map(str::parse).collect();
        assert!(
            matches!(numbers[..], [1, minor, _] if minor >= 24),
            "a release that was asked for: {version}"
        );
    }

    #[test]
    fn the_version_is_else_read_from_the_build_string_or_file_name() {
        let nothing = Path::new("/nowhere/libonnxruntime.so");
        assert!(said_version(nothing).is_err(), "it is not there");
        let info = "ORT Build Info: git-branch=rel-1.31.1, git-commit-id=abc";
        assert_eq!(version_from(info, nothing), "1.31.1", "by its branch");
        let named = Path::new("/nowhere/libonnxruntime.so.1.30.0");
        assert_eq!(version_from("", named), "1.30.0", "by its name");
        assert_eq!(version_from("", nothing), "unknown", "by nothing");
    }
}
