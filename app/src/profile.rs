//! Where the milliseconds go: one sample per stage and frame, summarised at the end.

use serde::Serialize;
use std::time::Duration;
use xr_renderer::StageTimes;

/// What a stage runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Unit {
    /// The neural processor.
    #[serde(rename = "NPU")]
    Npu,
    /// The graphics processor (lavapipe counts as one: it is the Vulkan device).
    #[serde(rename = "GPU")]
    Gpu,
    /// The central processor.
    #[serde(rename = "CPU")]
    Cpu,
}

impl Unit {
    /// The unit's name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Npu => "NPU",
            Self::Gpu => "GPU",
            Self::Cpu => "CPU",
        }
    }
}

/// A named step of a frame's way, in the order of that way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Forward kinematics: 55 joint transforms.
    Kinematics,
    /// The deform graph: F_mesh, LBS and F_attr.
    Deform,
    /// F_m2g and residuals: the Gaussians of the frame.
    Bind,
    /// Conversion to the renderer's layout.
    Pack,
    /// Copy to the GPU.
    Upload,
    /// Projection, culling, depth keys.
    Project,
    /// The 16-bit depth sort.
    Sort,
    /// Per-tile lists.
    Bin,
    /// Rasterisation of the tiles.
    Raster,
}

impl Stage {
    /// All stages in order.
    pub const ALL: [Self; 9] = [
        Self::Kinematics,
        Self::Deform,
        Self::Bind,
        Self::Pack,
        Self::Upload,
        Self::Project,
        Self::Sort,
        Self::Bin,
        Self::Raster,
    ];

    /// The stage's name in tables and JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Kinematics => "kinematics",
            Self::Deform => "deform (F_mesh, LBS, F_attr)",
            Self::Bind => "bind (F_m2g)",
            Self::Pack => "pack",
            Self::Upload => "upload",
            Self::Project => "project",
            Self::Sort => "sort",
            Self::Bin => "bin",
            Self::Raster => "raster",
        }
    }
}

/// Samples of every stage.
#[derive(Debug, Clone, Default)]
pub struct Profile {
    samples: [Vec<f64>; Stage::ALL.len()],
}

/// One row of the table: milliseconds of one stage over all frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageSummary {
    /// The stage's name.
    pub stage: &'static str,
    /// What it ran on.
    pub unit: Unit,
    /// Samples taken.
    pub frames: usize,
    /// Median, ms.
    pub p50_ms: f64,
    /// 95th percentile, ms.
    pub p95_ms: f64,
    /// Longest, ms.
    pub max_ms: f64,
}

impl Profile {
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

    /// One row per stage that has samples. `deform_unit` is where the deform graph's provider computes.
    #[must_use]
    pub fn summary(&self, deform_unit: Unit) -> Vec<StageSummary> {
        let row = |stage: Stage| {
            let mut sorted = self.samples[stage as usize].clone();
            sorted.sort_unstable_by(f64::total_cmp);
            let unit = match stage {
                Stage::Kinematics | Stage::Bind | Stage::Pack => Unit::Cpu,
                Stage::Deform => deform_unit,
                Stage::Upload | Stage::Project | Stage::Sort | Stage::Bin | Stage::Raster => {
                    Unit::Gpu
                }
            };
            Some(StageSummary {
                stage: stage.name(),
                unit,
                frames: sorted.len(),
                p50_ms: percentile(&sorted, 50)?,
                p95_ms: percentile(&sorted, 95)?,
                max_ms: *sorted.last()?,
            })
        };
        Stage::ALL.into_iter().filter_map(row).collect()
    }
}

/// Nearest-rank percentile of ascending samples.
pub(crate) fn percentile(sorted: &[f64], percent: usize) -> Option<f64> {
    sorted
        .get((sorted.len() * percent).div_ceil(100).saturating_sub(1))
        .copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_nearest_rank() {
        let mut profile = Profile::default();
        for ms in (1..=100).rev() {
            profile.record_ms(Stage::Sort, f64::from(ms));
        }
        let rows = profile.summary(Unit::Cpu);
        assert_eq!(rows.len(), 1, "stages without samples have no row");
        assert_eq!(
            (rows[0].p50_ms, rows[0].p95_ms, rows[0].max_ms),
            (50.0, 95.0, 100.0),
            "of 1..=100"
        );
        assert_eq!(rows[0].unit, Unit::Gpu, "the sort runs on the GPU");
    }
}
