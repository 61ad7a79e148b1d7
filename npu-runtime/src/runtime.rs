//! Loading the ONNX Runtime library and its one environment per process.

use crate::RuntimeError;
use ort::environment::Environment;
use ort::logging::LogLevel;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// The loaded ONNX Runtime. Cheap to clone; a process has one.
#[derive(Debug, Clone)]
pub struct Runtime {
    pub(crate) environment: Environment,
    library: PathBuf,
    version: String,
}

/// ONNX Runtime allows one environment per process, whoever asks first.
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
            .with_logger(Arc::new(forward_to_log))
            .build()
            .map_err(|e| fail(e.to_string()))?;
        let runtime = Self {
            environment,
            version: version_from(ort::info(), &library),
            library,
        };
        log::debug!(
            "ONNX Runtime {} from {}",
            runtime.version,
            runtime.library.display()
        );
        *loaded = Some(runtime.clone());
        Ok(runtime)
    }

    /// The library this runtime came from.
    #[must_use]
    pub fn library(&self) -> &Path {
        &self.library
    }

    /// Its version, e.g. `1.31.1`, as far as the library tells.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.version
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

/// The build string names a branch `rel-1.31.1` in official builds; the file's own name carries the version in others.
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

fn forward_to_log(level: LogLevel, _category: &str, _id: &str, location: &str, message: &str) {
    let level = match level {
        LogLevel::Verbose => log::Level::Trace,
        LogLevel::Info => log::Level::Debug,
        LogLevel::Warning => log::Level::Warn,
        LogLevel::Error | LogLevel::Fatal => log::Level::Error,
    };
    log::log!(level, "ONNX Runtime: {message} ({location})");
}
