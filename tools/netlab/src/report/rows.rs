//! The rows themselves, as data.

use serde::{Deserialize, Serialize};

use crate::DirectionStatistics;

/// Percentiles of the time from capture to when the deform stage may have the frame, in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LatencyMs {
    /// Half are faster.
    pub p50: f64,
    /// 19 of 20 are faster.
    pub p95: f64,
    /// 99 of 100 are faster.
    pub p99: f64,
}

impl LatencyMs {
    /// The percentiles of latencies in milliseconds, in any order; `None` of none. What is not a number does not count.
    pub fn of(samples: &[f64]) -> Option<Self> {
        let mut sorted: Vec<f64> = samples.iter().copied().filter(|s| !s.is_nan()).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        Some(Self {
            p50: percentile(&sorted, 50)?,
            p95: percentile(&sorted, 95)?,
            p99: percentile(&sorted, 99)?,
        })
    }
}

/// The nearest-rank percentile of growing numbers: the least that at least `percent` in a hundred do not exceed. `None` of none.
pub fn percentile(sorted: &[f64], percent: usize) -> Option<f64> {
    let rank = (sorted.len() * percent.min(100)).div_ceil(100);
    sorted.get(rank.max(1) - 1).copied()
}

/// The fate of one call's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Frames {
    /// Captured and due to be sent, skipped ones included.
    pub sent: u64,
    /// Decoded in time to be shown.
    pub shown: u64,
}

impl Frames {
    /// The share not shown, in percent.
    pub fn lost_percent(&self) -> f64 {
        self.sent.saturating_sub(self.shown) as f64 * 100.0 / self.sent.max(1) as f64
    }
}

/// One call under one condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CallRow {
    /// `paper` or `compact`.
    pub codec: String,
    /// `reliable` or `unreliable`.
    pub channel: String,
    /// The network's condition: `clean`, `1 % lost`.
    pub condition: String,
    /// From the sender to the viewer, as sent, IPv4 and UDP headers included.
    pub down_kbit_s: f64,
    /// From the viewer to the sender.
    pub up_kbit_s: f64,
    /// From capture to when the deform stage may have it; `None` if nothing came.
    pub latency_ms: Option<LatencyMs>,
    /// Their counts.
    pub frames: Frames,
    /// From the end of the (last) outage to the first frame shown after it; `None` where there was none, or no recovery.
    pub recover_s: Option<f64>,
    /// Where one was sent and heard.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub voice: Option<VoiceRow>,
}

/// The voice of a call.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VoiceRow {
    /// From the mouth to the ear; `None` if nothing was heard.
    pub mouth_to_ear_ms: Option<LatencyMs>,
    /// How far apart what was heard and what was seen of one moment were.
    pub apart_ms: Option<LatencyMs>,
    /// Frames of 20 ms that were heard as they were sent, taken from copies, and concealed.
    pub heard: u64,
    /// See [`Self::heard`].
    pub recovered: u64,
    /// See [`Self::heard`].
    pub concealed: u64,
    /// The most that were concealed in a row, milliseconds.
    pub longest_gap_ms: u64,
}

impl VoiceRow {
    /// The share that was concealed, in percent.
    pub fn concealed_percent(&self) -> f64 {
        let all = self.heard + self.recovered + self.concealed;
        self.concealed as f64 * 100.0 / all.max(1) as f64
    }
}

impl CallRow {
    /// `compact, unreliable`: the variant, apart from its condition.
    pub(super) fn variant(&self) -> String {
        format!("{}, {}", self.codec, self.channel)
    }
}

/// A bitrate over time, to be drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BitrateSeries {
    /// What it is the bitrate of.
    pub name: String,
    /// One figure a second, in kbit/s with headers.
    pub kbit_s: Vec<f64>,
}

impl BitrateSeries {
    /// What was sent into the lab in one direction, without the last second, which is not over.
    pub fn offered(name: &str, direction: &DirectionStatistics) -> Self {
        let whole = direction.seconds.len().saturating_sub(1);
        Self {
            name: name.to_owned(),
            kbit_s: direction
                .seconds
                .iter()
                .take(whole)
                .map(|s| s.offered_kbit_s)
                .collect(),
        }
    }
}

/// The results of a measurement.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Report {
    /// What was measured: `Motion calls at 60 Hz, 20 ms each way`.
    pub title: String,
    /// The calls.
    pub calls: Vec<CallRow>,
    /// Bitrates over time; may be empty.
    pub bitrates: Vec<BitrateSeries>,
    /// Notes for the reader, a sentence each.
    pub notes: Vec<String>,
}

impl Report {
    /// The report as JSON.
    pub fn to_json(&self) -> String {
        // Plain data with string keys always serialises; what is not a finite number becomes null.
        serde_json::to_string_pretty(self).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_ranks() {
        let hundred: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!(
            LatencyMs::of(&hundred),
            Some(LatencyMs {
                p50: 50.0,
                p95: 95.0,
                p99: 99.0
            }),
            "of 1 to 100"
        );
        let one = LatencyMs::of(&[7.0, f64::NAN]).map(|l| (l.p50, l.p99));
        assert_eq!(one, Some((7.0, 7.0)), "of a single one");
        assert_eq!(LatencyMs::of(&[]), None, "of none");
        assert_eq!(percentile(&[1.0, 2.0, 3.0], 0), Some(1.0), "the least");
        assert_eq!(percentile(&[1.0, 2.0, 3.0], 100), Some(3.0), "the most");
    }

    #[test]
    fn a_report_is_read_back_from_json() {
        let report = crate::report::samples::report();
        let back: Report = serde_json::from_str(&report.to_json()).expect("its own JSON");
        assert_eq!(back, report, "through JSON and back");
    }
}
