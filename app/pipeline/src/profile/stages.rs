//! How long each stage takes: one sample per stage and frame, and one row of a table per stage.

use super::recorded::{ms, nanoseconds};
use crate::profile::{Percentiles, Recording};
use crate::stage::{Stage, Unit};
use renderer_splat::times::StageTimes;
use serde::Serialize;
use std::time::Duration;

/// Samples of every stage.
#[derive(Debug, Clone, Default)]
pub struct Profile {
    samples: [Vec<f64>; Stage::ALL.len()],
}

/// One row of the table: milliseconds of one stage over all frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageSummary {
    /// The stage.
    pub stage: Stage,
    /// What it ran on.
    pub unit: Unit,
    /// What it took, for each frame it had.
    #[serde(flatten)]
    pub times: Percentiles,
    /// What its median takes of a display period if it runs as often as it should: each picture, or each motion frame.
    /// 1 is all of it. Unknown where there is no display.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub display_share: Option<f64>,
}

impl Profile {
    /// One sample per stage and frame of a recording: a stage done in slices takes as long as all of them.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        let mut slices: Vec<(Stage, u64, i64)> = (recording.spans.iter())
            .map(|span| (span.stage, span.frame, nanoseconds(span.begin, span.end)))
            .collect();
        slices.sort_unstable();
        let mut profile = Self::default();
        for frame in slices.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            if let Some((stage, ..)) = frame.first() {
                profile.record_ms(*stage, ms(frame.iter().map(|(.., time)| time).sum()));
            }
        }
        profile
    }

    /// Adds one sample measured on this side of the device.
    pub fn record(&mut self, stage: Stage, time: Duration) {
        self.record_ms(stage, time.as_secs_f64() * 1e3);
    }

    /// Adds one sample in milliseconds, as GPU timestamps give it.
    pub fn record_ms(&mut self, stage: Stage, milliseconds: f64) {
        self.samples[stage as usize].push(milliseconds);
    }

    /// Adds one sample for each of the renderer's stages.
    pub fn record_picture(&mut self, times: &StageTimes) {
        for (stage, milliseconds) in [
            (Stage::Upload, times.upload),
            (Stage::Project, times.project),
            (Stage::Sort, times.sort),
            (Stage::Bin, times.bin),
            (Stage::Raster, times.raster),
        ] {
            self.record_ms(stage, milliseconds);
        }
    }

    /// Forgets all samples and keeps their memory.
    pub fn clear(&mut self) {
        self.samples.iter_mut().for_each(Vec::clear);
    }

    /// One row per stage that has samples, which ran on `unit_of` it.
    #[must_use]
    pub fn summary(&self, unit_of: impl Fn(Stage) -> Unit) -> Vec<StageSummary> {
        let row = |stage: Stage| {
            Some(StageSummary {
                stage,
                unit: unit_of(stage),
                times: Percentiles::of(&self.samples[stage as usize])?,
                display_share: None,
            })
        };
        Stage::ALL.into_iter().filter_map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_has_a_row_only_if_it_has_samples() {
        let mut profile = Profile::default();
        for ms in [3.0, 1.0, 2.0] {
            profile.record_ms(Stage::Sort, ms);
        }
        let rows = profile.summary(|stage| stage.legal_units()[0]);
        assert_eq!(rows.len(), 1, "stages without samples have no row");
        assert_eq!(rows[0].times.p50_ms, 2.0, "the median of 1, 2, 3");
        assert_eq!(rows[0].unit, Unit::Gpu, "the sort runs on the GPU");
    }
}
