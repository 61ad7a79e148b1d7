//! The QNN execution provider: a plugin library beside ONNX Runtime, found, registered once, and always given the chip.

use crate::devices::devices;
use crate::{ProviderKind, QnnTarget};
use ort::environment::Environment;
use ort::session::builder::SessionBuilder;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// Name it is registered under, which is also the prefix of its options; options without it are ignored.
const NAME: &str = "QNNExecutionProvider";
/// Names the folder that holds the plugin, or the plugin itself.
pub const QNN_VARIABLE: &str = "MON3TR_QNN";

/// The registered plugin.
#[derive(Debug)]
pub(crate) struct Plugin {
    library: PathBuf,
    fingerprint: String,
}

impl Plugin {
    /// Finds the plugin beside the library `onnx_runtime`, or where the variable says, and registers it; else why not, in words.
    pub(crate) fn register(environment: &Environment, onnx_runtime: &Path) -> Result<Self, String> {
        let named = std::env::var_os(QNN_VARIABLE).filter(|value| !value.is_empty());
        let library = find(named.as_deref().map(Path::new), onnx_runtime)?;
        let fingerprint = fingerprint(&library)
            .map_err(|e| format!("cannot read the plugin {}: {e}", library.display()))?;
        environment
            .register_ep_library(NAME, &library)
            .map_err(|e| {
                format!(
                    "ONNX Runtime cannot load the plugin {}: {e}",
                    library.display()
                )
            })?;
        if devices(environment, ProviderKind::Qnn).next().is_none() {
            return Err(format!(
                "the plugin {} finds no device it could run on",
                library.display()
            ));
        }
        log::debug!("QNN plugin {} ({fingerprint})", library.display());
        Ok(Self {
            library,
            fingerprint,
        })
    }

    /// The plugin's file.
    pub(crate) fn library(&self) -> &Path {
        &self.library
    }

    /// Differs where the plugin or a library of QNN beside it differs.
    pub(crate) fn fingerprint(&self) -> &str {
        &self.fingerprint
    }

    /// Session options that put everything on the NPU of `target`, or fail.
    pub(crate) fn configure(
        &self,
        environment: &Environment,
        builder: SessionBuilder,
        target: QnnTarget,
    ) -> Result<SessionBuilder, ort::Error> {
        let options = [
            ("backend_type", "htp".to_owned()),
            // Always both: see `QnnTarget`.
            ("soc_model", target.soc_model().to_string()),
            ("htp_arch", target.htp_arch().to_string()),
            ("enable_htp_fp16_precision", "1".to_owned()),
            // The NPU lane has only this work, and a deadline.
            ("htp_performance_mode", "burst".to_owned()),
        ]
        .map(|(key, value)| (format!("{NAME}.{key}"), value));
        Ok(builder.with_disable_cpu_fallback()?.with_devices(
            devices(environment, ProviderKind::Qnn).take(1),
            Some(&options),
        )?)
    }
}

/// The plugin's file: at the path `named`, else beside ONNX Runtime's library.
fn find(named: Option<&Path>, runtime: &Path) -> Result<PathBuf, String> {
    let file = format!(
        "{}onnxruntime_providers_qnn{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    let candidate = match named {
        Some(path) if path.is_dir() => path.join(&file),
        Some(path) => path.to_path_buf(),
        None => std::fs::canonicalize(runtime)
            .unwrap_or_else(|_| runtime.to_path_buf())
            .with_file_name(&file),
    };
    if candidate.is_file() {
        return Ok(candidate);
    }
    if cfg!(target_os = "android") {
        return Err("the app was packaged without QNN".into());
    }
    let how = match named {
        Some(_) => format!("where {QNN_VARIABLE} points"),
        None => format!("beside ONNX Runtime, and {QNN_VARIABLE} is not set"),
    };
    Err(format!(
        "there is no {} {how}: ./run setup fetches the plugin on Linux x86-64, or point {QNN_VARIABLE} to the folder \
         onnxruntime_qnn of the PyPI package onnxruntime-qnn",
        candidate.display()
    ))
}

/// SHA-256 of the plugin, with names and sizes of QNN's libraries beside it: hashing those 100 MB too would take longer
/// than loading what was compiled with them.
fn fingerprint(library: &Path) -> std::io::Result<String> {
    let mut hash = Sha256::new();
    hash.update(std::fs::read(library)?);
    let folder = library.parent().unwrap_or(Path::new("."));
    let mut beside = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.contains("Qnn") || name.contains("HtpPrepare") {
            beside.push(format!("{name} {}\n", entry.metadata()?.len()));
        }
    }
    beside.sort_unstable();
    for line in beside {
        hash.update(line);
    }
    Ok(crate::cache::hexadecimal(&hash.finalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absent_plugin_is_reported_with_where_it_was_looked_for() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let runtime = folder.path().join("libonnxruntime.so");
        let alone = find(None, &runtime).expect_err("nothing is there");
        assert!(alone.contains(QNN_VARIABLE), "{alone}");
        assert!(alone.contains(&*folder.path().to_string_lossy()), "{alone}");
        let named = find(Some(folder.path()), &runtime).expect_err("an empty folder");
        assert!(named.contains("onnxruntime_providers_qnn"), "{named}");
    }

    #[test]
    fn the_plugin_is_found_by_folder_by_file_and_beside_the_runtime() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folder = std::fs::canonicalize(folder.path()).expect("it exists");
        let file = folder.join(format!(
            "{}onnxruntime_providers_qnn{}",
            std::env::consts::DLL_PREFIX,
            std::env::consts::DLL_SUFFIX
        ));
        let runtime = folder.join("libonnxruntime.so");
        std::fs::write(&runtime, "runtime").expect("a file");
        std::fs::write(&file, "plugin").expect("a file");
        for named in [Some(&*folder), Some(&*file), None] {
            assert_eq!(find(named, &runtime).as_ref(), Ok(&file), "{named:?}");
        }
        let before = fingerprint(&file).expect("readable");
        std::fs::write(folder.join("libQnnHtp.so"), "other").expect("a file");
        let after = fingerprint(&file).expect("readable");
        assert_ne!(before, after, "another backend is another plugin");
    }
}
