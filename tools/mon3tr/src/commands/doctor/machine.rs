//! What this machine has for calls, and what to do where something is missing.

use crate::device_options::{DeviceOptions, cache, describe, networks};
use anyhow::{Context, bail};
use npu_runtime::ProviderKind;
use renderer_openxr::headset::{Headset, HeadsetOptions};
use serde::Serialize;
use sound_devices::SoundServer;
use std::path::Path;
use tracker::source::find_ffmpeg;

/// Less room than this may not hold the avatars of a call.
const LITTLE_ROOM: u64 = 2 << 30;

/// One thing that a call may need.
#[derive(Debug, Serialize)]
pub(super) struct Part {
    name: &'static str,
    /// What it is for.
    gives: &'static str,
    is_there: bool,
    /// What was found, or why it is missing and what to do.
    found: String,
}

impl Part {
    fn of(name: &'static str, gives: &'static str, found: anyhow::Result<String>) -> Self {
        Self {
            name,
            gives,
            is_there: found.is_ok(),
            found: found.unwrap_or_else(|error| format!("{error:#}")),
        }
    }
}

/// Looks at all of them. Nothing is opened for longer than that, and nothing recorded.
pub(super) fn parts(device: &DeviceOptions) -> Vec<Part> {
    let mut parts = vec![
        Part::of(
            "Vulkan",
            "draws people",
            device.gpu().map(|gpu| describe(&gpu)),
        ),
        Part::of("OpenXR", "shows them in a headset", headset()),
    ];
    parts.extend(inference(device));
    parts.extend([
        Part::of("camera", "captures you", camera()),
        Part::of(
            "networks",
            "see body, hands and face in its pictures",
            networks().map(|folder| folder.display().to_string()),
        ),
        Part::of(
            "ffmpeg",
            "reads videos and network cameras",
            find_ffmpeg()
                .map(|path| path.display().to_string())
                .map_err(Into::into),
        ),
        Part::of(
            "sound",
            "microphone and loudspeaker",
            SoundServer::find()
                .map(|_| "a sound server runs".to_owned())
                .map_err(Into::into),
        ),
        Part::of(
            "disk",
            "keeps avatars",
            cache().and_then(|path| room(&path)),
        ),
    ]);
    parts
}

fn headset() -> anyhow::Result<String> {
    let runtime = renderer_openxr::runtime::Runtime::load()?;
    let headset = Headset::open(&runtime, HeadsetOptions::default())?;
    let info = headset.info();
    Ok(format!("{} by {}", info.name, info.runtime))
}

/// ONNX Runtime and the processors that it can use.
fn inference(device: &DeviceOptions) -> Vec<Part> {
    const GIVES: &str = "runs the avatars' networks";
    let runtime = match device.runtime() {
        Ok(runtime) => runtime,
        Err(error) => return vec![Part::of("ONNX Runtime", GIVES, Err(error))],
    };
    let found = format!("{} ({})", runtime.version(), runtime.library().display());
    let of_npu = |kind| matches!(kind, ProviderKind::Qnn | ProviderKind::Nnapi);
    let npus = runtime
        .probe()
        .into_iter()
        .filter(|one| of_npu(one.provider));
    let (there, missing): (Vec<_>, Vec<_>) = npus.partition(|one| one.lacking.is_none());
    let npu = if there.is_empty() {
        let why = missing.iter().filter_map(|one| {
            let why = one.lacking.as_ref()?;
            Some(format!("{}: {why}", one.provider))
        });
        let why = why.collect::<Vec<_>>().join("; ");
        Err(anyhow::anyhow!("{why}; the CPU does without"))
    } else {
        let names = there.iter().map(|one| one.provider.to_string());
        Ok(names.collect::<Vec<_>>().join(", "))
    };
    vec![
        Part::of("ONNX Runtime", GIVES, Ok(found)),
        Part::of("NPU", "runs them beside the rest", npu),
    ]
}

/// The system's cameras, which are not opened.
#[cfg(target_os = "linux")]
fn camera() -> anyhow::Result<String> {
    let mut cameras: Vec<String> = std::fs::read_dir("/dev")
        .context("cannot read /dev")?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.starts_with("video"))
        .collect();
    if cameras.is_empty() {
        bail!(
            "none is connected: --motion FILE moves you instead, or --camera takes a video or a network camera"
        );
    }
    cameras.sort();
    Ok(format!("/dev/{}", cameras.join(", /dev/")))
}

#[cfg(not(target_os = "linux"))]
fn camera() -> anyhow::Result<String> {
    bail!("cameras are opened through ffmpeg here: --camera FILE or URL")
}

/// Room where avatars and what is fetched are kept.
#[cfg(unix)]
fn room(folder: &Path) -> anyhow::Result<String> {
    // The folder may have to be made yet.
    let there = folder.ancestors().find(|path| path.exists());
    let there = there.with_context(|| format!("there is no {}", folder.display()))?;
    let status = rustix::fs::statvfs(there)
        .with_context(|| format!("cannot look at {}", there.display()))?;
    let free = status.f_bavail.saturating_mul(status.f_frsize);
    let gigabytes = free as f64 / f64::from(1 << 30);
    if free < LITTLE_ROOM {
        bail!(
            "{gigabytes:.1} GB are free at {}: make room there, or set MON3TR_CACHE to another folder",
            folder.display()
        );
    }
    Ok(format!("{gigabytes:.0} GB free at {}", folder.display()))
}

#[cfg(not(unix))]
fn room(folder: &Path) -> anyhow::Result<String> {
    Ok(folder.display().to_string())
}

/// Prints them as a table.
pub(super) fn print(parts: &[Part]) {
    let width = |of: fn(&Part) -> &str| parts.iter().map(|part| of(part).len()).max().unwrap_or(0);
    let (name, gives) = (width(|part| part.name), width(|part| part.gives));
    for part in parts {
        let mark = if part.is_there { "there  " } else { "missing" };
        println!(
            "{mark}  {:name$}  {:gives$}  {}",
            part.name, part.gives, part.found
        );
    }
}
