//! What `send` reports of its memory: whether it grows over a long call.

use profile_report::{Memory, resident_bytes};
use sender::{Capture, Captured, SendError};
use serde::Serialize;
use std::time::{Duration, Instant};

/// When everything that is needed for sending has been taken.
const SETTLED: Duration = Duration::from_secs(60);

/// Memory of the sender's process, bytes; missing where the system does not say.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct SenderMemory {
    /// A minute after it began to send; nothing where it ended before.
    settled_bytes: Option<u64>,
    end_bytes: Option<u64>,
    peak_bytes: Option<u64>,
}

impl SenderMemory {
    /// As it is now, at the end.
    pub(super) fn at_the_end(settled_bytes: Option<u64>) -> Self {
        let Memory {
            host_bytes,
            host_peak_bytes,
            ..
        } = Memory::now(0, None);
        Self {
            settled_bytes,
            end_bytes: host_bytes,
            peak_bytes: host_peak_bytes,
        }
    }

    /// In a line; nothing where the system says nothing.
    pub(super) fn line(&self) -> Option<String> {
        let mb = |bytes: u64| format!("{:.0} MB", bytes as f64 / 1e6);
        let settled = (self.settled_bytes)
            .map(|bytes| format!("{} after a minute, ", mb(bytes)))
            .unwrap_or_default();
        Some(format!(
            "memory: {settled}{} at the end, {} at most",
            mb(self.end_bytes?),
            mb(self.peak_bytes?)
        ))
    }
}

/// A source of motion whose process' memory is looked at a minute after it began.
pub(super) struct Watched<'a> {
    capture: &'a mut dyn Capture,
    begun: Instant,
    pub(super) settled_bytes: Option<u64>,
}

impl<'a> Watched<'a> {
    pub(super) fn over(capture: &'a mut dyn Capture) -> Self {
        Self {
            capture,
            begun: Instant::now(),
            settled_bytes: None,
        }
    }
}

impl Capture for Watched<'_> {
    fn next(&mut self) -> Result<Option<Captured>, SendError> {
        if self.settled_bytes.is_none() && self.begun.elapsed() >= SETTLED {
            self.settled_bytes = resident_bytes();
        }
        self.capture.next()
    }
}
