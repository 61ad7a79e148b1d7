//! How a session goes while it lasts, as lines of JSON: what a long call's figures at its end do not tell.

use anyhow::Context;
use app_pipeline::lanes::Lanes;
use app_pipeline::profile::{LatencyBreakdown, Percentiles, Recording, Since};
use app_session::attendee::Attendee;
use app_session::display::SessionObserver;
use app_session::participant::PersonSource;
use serde::Serialize;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

/// From one line to the next.
const EVERY: Duration = Duration::from_secs(2);

/// One line: of the first person.
#[derive(Debug, Serialize)]
struct Sample {
    /// Since the session was first looked at.
    seconds: f64,
    /// Pictures displayed since the line before.
    pictures: usize,
    /// Where their latency is counted from.
    #[serde(skip_serializing_if = "Option::is_none")]
    since: Option<Since>,
    /// From there to the display, of the pictures since the line before.
    #[serde(skip_serializing_if = "Option::is_none")]
    latency: Option<Percentiles>,
    /// Motion frames that came since the call was begun, where there is a call.
    frames: u64,
    /// Motion frames that never came.
    lost: u64,
    /// Device memory that the renderer has taken.
    device_bytes: u64,
}

/// Writes a line every two seconds.
#[derive(Debug)]
pub(super) struct Samples {
    file: File,
    begun: Option<Instant>,
    last: Option<Instant>,
    failed: bool,
}

impl Samples {
    /// Into a new file.
    ///
    /// # Errors
    /// If it cannot be made.
    pub(super) fn create(path: &Path) -> anyhow::Result<Self> {
        let file =
            File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Self {
            file,
            begun: None,
            last: None,
            failed: false,
        })
    }

    fn write(&mut self, sample: &Sample) -> anyhow::Result<()> {
        let line = serde_json::to_string(sample)? + "\n";
        // A line at a time: whoever reads it meanwhile finds whole ones.
        Ok(self.file.write_all(line.as_bytes())?)
    }
}

impl SessionObserver for Samples {
    fn look(&mut self, lanes: &mut Lanes<PersonSource>, people: &[Attendee]) {
        let now = Instant::now();
        let begun = *self.begun.get_or_insert(now);
        let last = *self.last.get_or_insert(now);
        if self.failed || now.saturating_duration_since(last) < EVERY {
            return;
        }
        self.last = Some(now);
        let recording = Recording::newest(lanes.collector(), last, now);
        let latency = LatencyBreakdown::new(&recording.pictures, None);
        let counts = (people.first()).and_then(|person| person.watch.as_ref());
        let counts = counts.map(|watch| watch.counts()).unwrap_or_default();
        let sample = Sample {
            seconds: now.saturating_duration_since(begun).as_secs_f64(),
            pictures: recording.pictures.len(),
            since: latency.as_ref().map(|latency| latency.since),
            latency: latency.map(|latency| latency.whole),
            frames: counts.frames,
            lost: counts.lost,
            device_bytes: lanes.renderer().gpu().memory_taken(),
        };
        if let Err(error) = self.write(&sample) {
            log::warn!("no more samples are written: {error:#}");
            self.failed = true;
        }
    }
}
