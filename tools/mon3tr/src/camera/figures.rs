//! What the stages of capturing took.

use serde::Serialize;
use std::collections::VecDeque;
use std::time::Duration;
use tracker::workers::StageTimes;

/// Pictures whose times are kept.
const TIMED: usize = 4096;

/// Median milliseconds of the camera's stages.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct CameraFigures {
    /// Pictures that were looked at.
    pub(crate) pictures: u64,
    /// Of a live source, pictures that came while another was looked at.
    pub(crate) skipped: u64,
    pub(crate) body_ms: f64,
    /// The slower hand: both have networks of their own.
    pub(crate) hands_ms: f64,
    pub(crate) face_ms: f64,
    /// All networks of a picture together: they run beside one another.
    pub(crate) networks_ms: f64,
    /// The fit; of a live source and its smoothing.
    pub(crate) fit_ms: f64,
    /// Of a recording, the smoothing of the whole: mean of a picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) smoothing_ms: Option<f64>,
    /// From the light to the motion. A recording that is read as fast as it can be has none: its light fell long ago.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) latency_ms: Option<f64>,
}

impl CameraFigures {
    /// The figures in a line.
    pub(crate) fn print(&self) {
        let live = |text: String| self.latency_ms.map_or_else(String::new, |_| text);
        println!(
            "{} pictures{}; median ms: body {:.1}, hands {:.1}, face {:.1}, these together {:.1}, fit {:.2}{}{}",
            self.pictures,
            live(format!(", {} more skipped", self.skipped)),
            self.body_ms,
            self.hands_ms,
            self.face_ms,
            self.networks_ms,
            self.fit_ms,
            self.smoothing_ms
                .map_or_else(String::new, |ms| format!(", smoothing {ms:.2} on average")),
            self.latency_ms
                .map_or_else(String::new, |latency_ms| format!(
                    ", from the light to the motion {latency_ms:.1}"
                )),
        );
    }
}

/// What one picture took.
#[derive(Debug, Clone, Copy)]
pub(super) struct PictureTimes {
    pub(super) networks: StageTimes,
    pub(super) fit_ms: f64,
    /// From the light to the motion.
    pub(super) latency_ms: f64,
}

/// What the newest pictures took, and how many there were.
#[derive(Debug, Default)]
pub(super) struct Record {
    newest: VecDeque<PictureTimes>,
    pictures: u64,
    skipped: u64,
    last: Option<u64>,
    smoothing_ms: Option<f64>,
}

impl Record {
    /// Counts the picture `number` of its source, and those that were left out since the one before.
    pub(super) fn count(&mut self, number: u64) {
        self.pictures += 1;
        if let Some(last) = self.last.replace(number) {
            self.skipped += number.saturating_sub(last + 1);
        }
    }

    /// Keeps what a picture took.
    pub(super) fn add(&mut self, times: PictureTimes) {
        if self.newest.len() == TIMED {
            self.newest.pop_front();
        }
        self.newest.push_back(times);
    }

    /// Keeps what the smoothing of so many pictures took altogether.
    pub(super) fn add_smoothing(&mut self, took: Duration, pictures: usize) {
        self.smoothing_ms = Some(took.as_secs_f64() * 1e3 / pictures.max(1) as f64);
    }

    /// Forgets the times so far, and that there was a picture before the next one.
    pub(super) fn begin_anew(&mut self) {
        self.last = None;
        self.newest.clear();
    }

    /// The medians; with the latency where the source is live.
    pub(super) fn figures(&self, is_live: bool) -> CameraFigures {
        let median = |of: &dyn Fn(&PictureTimes) -> f64| {
            let mut values: Vec<f64> = self.newest.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        };
        CameraFigures {
            pictures: self.pictures,
            skipped: self.skipped,
            body_ms: median(&|times| times.networks.body_ms.into()),
            hands_ms: median(&|PictureTimes { networks, .. }| {
                networks.hands_ms[0].max(networks.hands_ms[1]).into()
            }),
            face_ms: median(&|times| times.networks.face_ms.into()),
            networks_ms: median(&|times| times.networks.total_ms.into()),
            fit_ms: median(&|times| times.fit_ms),
            smoothing_ms: self.smoothing_ms,
            latency_ms: is_live.then(|| median(&|times| times.latency_ms)),
        }
    }
}
