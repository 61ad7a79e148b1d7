//! One look at a call: a line of the table of samples.

use crate::usage::Usage;
use serde::{Deserialize, Serialize};

/// The programs of a call, in the order of [`Sample::processes`].
pub(super) const PROGRAMS: [&str; 3] = ["serve", "send", "receive"];

/// What was seen at one moment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Sample {
    /// Since the call was live.
    pub(super) seconds: f64,
    /// Server, sender, receiver.
    pub(super) processes: [Usage; PROGRAMS.len()],
    /// What the receiver has written since the look before; nothing while its headset is away.
    pub(super) shown: Option<Shown>,
    /// Messages of Vulkan's validation layer in the receiver, since it began.
    pub(super) validation_messages: u64,
    /// Whether the headset's runtime was there.
    pub(super) runtime: bool,
    /// Of the machine, as `/proc/loadavg` has it for one minute.
    pub(super) load: Option<f64>,
}

/// What `receive --samples` writes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Shown {
    /// Pictures displayed since the line before.
    pub(super) pictures: u64,
    /// From capture to display, of those pictures.
    pub(super) latency: Option<Latency>,
    /// Motion frames that came since the call was begun.
    pub(super) frames: u64,
    /// Those that never came.
    pub(super) lost: u64,
    /// Device memory that the renderer has taken.
    pub(super) device_bytes: u64,
}

/// Percentiles of a latency.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Latency {
    /// Median.
    pub(super) p50_ms: f64,
    /// 99th percentile.
    pub(super) p99_ms: f64,
}

impl Sample {
    /// The heading of the table of samples.
    pub(super) fn heading() -> String {
        let mut columns = vec!["seconds".to_owned()];
        for program in PROGRAMS {
            let its = ["resident_bytes", "descriptors", "threads"];
            columns.extend(its.map(|what| format!("{program}_{what}")));
        }
        columns.extend(
            [
                "device_bytes",
                "pictures",
                "latency_p50_ms",
                "latency_p99_ms",
                "frames",
                "lost",
                "validation_messages",
                "runtime",
                "load",
            ]
            .map(str::to_owned),
        );
        columns.join(",")
    }

    /// Its line; a value that is not known is empty.
    pub(super) fn line(&self) -> String {
        let mut values = vec![format!("{:.2}", self.seconds)];
        for usage in &self.processes {
            let its = [usage.resident_bytes, usage.descriptors, usage.threads];
            values.extend(its.map(|value| value.to_string()));
        }
        let shown = self.shown.as_ref();
        let count = |value: fn(&Shown) -> u64| shown.map(|shown| value(shown).to_string());
        let latency = shown.and_then(|shown| shown.latency);
        let ms = |value: fn(&Latency) -> f64| latency.map(|ms| format!("{:.3}", value(&ms)));
        let rest = [
            count(|shown| shown.device_bytes),
            count(|shown| shown.pictures),
            ms(|ms| ms.p50_ms),
            ms(|ms| ms.p99_ms),
            count(|shown| shown.frames),
            count(|shown| shown.lost),
            Some(self.validation_messages.to_string()),
            Some(u8::from(self.runtime).to_string()),
            self.load.map(|load| load.to_string()),
        ];
        values.extend(rest.map(Option::unwrap_or_default));
        values.join(",")
    }
}
