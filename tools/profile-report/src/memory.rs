//! How much memory the receiver takes: of the process, of the device, and of ONNX Runtime's session.

use serde::Serialize;

/// Bytes; missing where the machine does not report them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Memory {
    /// Resident set of this process when measuring ended.
    pub host_bytes: Option<u64>,
    /// The most it ever was.
    pub host_peak_bytes: Option<u64>,
    /// Device memory that the renderer has taken.
    pub device_bytes: u64,
    /// What the resident set grew by when placements were tried and one was kept: ONNX Runtime, sessions, the renderer.
    pub onnx_runtime_bytes: Option<u64>,
}

impl Memory {
    /// As it is now.
    #[must_use]
    pub fn now(device_bytes: u64, onnx_runtime_bytes: Option<u64>) -> Self {
        Self {
            host_bytes: resident_bytes(),
            host_peak_bytes: of_status("VmHWM:"),
            device_bytes,
            onnx_runtime_bytes,
        }
    }

    /// One line for people.
    pub(crate) fn line(&self) -> String {
        let mb = |bytes: Option<u64>| {
            bytes.map_or_else(|| "?".into(), |b| format!("{:.0} MB", b as f64 / 1e6))
        };
        format!(
            "memory     host {} now ({} since before placements were tried), {} at most; device {}",
            mb(self.host_bytes),
            mb(self.onnx_runtime_bytes),
            mb(self.host_peak_bytes),
            mb(Some(self.device_bytes))
        )
    }
}

/// This process' resident set now, bytes.
#[must_use]
pub fn resident_bytes() -> Option<u64> {
    of_status("VmRSS:")
}

/// A line of Linux' `/proc/self/status`, which are in KiB. Elsewhere there is none.
fn of_status(name: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn used_memory_is_counted() {
        const MORE: usize = 64 << 20;
        let before = resident_bytes().expect("Linux tells");
        let kept = std::hint::black_box(vec![1_u8; MORE]);
        let grown = resident_bytes().expect("Linux tells") - before;
        assert!(grown > MORE as u64 / 2, "{grown} bytes more");
        drop(kept);
        // By the kernel's counts, which lag behind a little.
        let peak = Memory::now(0, None).host_peak_bytes;
        assert!(
            peak >= Some(MORE as u64 / 2),
            "{peak:?} is the most there was"
        );
    }
}
