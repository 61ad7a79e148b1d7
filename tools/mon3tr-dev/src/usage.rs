//! What a process takes of the machine, as Linux tells.

use anyhow::{Context, anyhow};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What a process takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(crate) struct Usage {
    /// Memory that is resident, bytes: the device's too, where that is software.
    pub(crate) resident_bytes: u64,
    /// Open descriptors.
    pub(crate) descriptors: u64,
    /// Threads.
    pub(crate) threads: u64,
}

impl Usage {
    /// Of the process with this number, now.
    ///
    /// # Errors
    /// If it is gone, or the system tells nothing of it.
    pub(crate) fn of(process: u32) -> anyhow::Result<Self> {
        let folder = folder(process);
        let status = std::fs::read_to_string(folder.join("status"))
            .with_context(|| format!("cannot look at process {process}"))?;
        let field = |name: &str| {
            field(&status, name)
                .ok_or_else(|| anyhow!("the system does not tell {name} of process {process}"))
        };
        let descriptors = std::fs::read_dir(folder.join("fd"))
            .with_context(|| format!("cannot count the descriptors of process {process}"))?;
        Ok(Self {
            resident_bytes: field("VmRSS:")? * 1024,
            descriptors: descriptors.count() as u64,
            threads: field("Threads:")?,
        })
    }
}

/// Whether a library whose file's name contains `name` is loaded in a process.
pub(crate) fn has_loaded(process: u32, name: &str) -> anyhow::Result<bool> {
    let maps = std::fs::read_to_string(folder(process).join("maps"))
        .with_context(|| format!("cannot look at process {process}"))?;
    Ok(maps.contains(name))
}

/// How many threads wanted a processor in the last minute, on average, of all programs; nothing where the system does not say.
pub(crate) fn load() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/loadavg").ok()?;
    text.split_whitespace().next()?.parse().ok()
}

fn folder(process: u32) -> PathBuf {
    Path::new("/proc").join(process.to_string())
}

/// The number in a line of `/proc/PID/status`; memory is in KiB there.
fn field(status: &str, name: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn what_this_process_takes_is_told() {
        const MORE: usize = 64 << 20;
        let before = Usage::of(std::process::id()).expect("Linux tells");
        let kept = std::hint::black_box(vec![1_u8; MORE]);
        let file = std::fs::File::open("/dev/null").expect("it is there");
        let after = Usage::of(std::process::id()).expect("Linux tells");
        let grown = after.resident_bytes.saturating_sub(before.resident_bytes);
        assert!(grown > MORE as u64 / 2, "{grown} bytes more");
        assert!(after.descriptors >= 4, "streams and a file: {after:?}");
        assert!(after.threads >= 1, "this one: {after:?}");
        drop((kept, file));
    }

    #[test]
    fn a_process_that_is_gone_is_named() {
        let error = Usage::of(u32::MAX).expect_err("there is none");
        assert!(error.to_string().contains("4294967295"), "{error}");
    }
}
