//! What a run measured, as a table for people and as JSON for programs.

use crate::performance::Performance;
use anyhow::{Context, bail};
use app::StageSummary;
use npu_runtime::Runtime;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xr_renderer::Gpu;

/// Picture paths printed; the JSON has them all.
const SHOWN: usize = 9;

/// Everything `render` and `demo` print.
#[derive(Debug, Serialize)]
pub(crate) struct RunReport {
    pub(crate) avatar: AvatarFigures,
    pub(crate) motion: String,
    pub(crate) motion_frames: usize,
    pub(crate) vulkan_device: String,
    pub(crate) vulkan_driver: String,
    pub(crate) onnx_runtime: String,
    pub(crate) runs: Vec<StageTable>,
    pub(crate) pictures: Vec<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) bake: Option<serde_json::Value>,
}

/// Sizes of the avatar that was shown.
#[derive(Debug, Serialize)]
pub(crate) struct AvatarFigures {
    pub(crate) name: String,
    pub(crate) package: PathBuf,
    pub(crate) package_bytes: u64,
    pub(crate) vertices: usize,
    pub(crate) triangles: usize,
    pub(crate) gaussians: usize,
    pub(crate) controllers: usize,
}

/// Stage times of one kind of picture.
#[derive(Debug, Serialize)]
pub(crate) struct StageTable {
    pub(crate) views: usize,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) stages: Vec<StageSummary>,
    /// Sum of the stages' medians: what a frame takes when nothing overlaps.
    pub(crate) sum_of_medians_ms: f64,
}

impl StageTable {
    pub(crate) fn new(views: usize, width: u32, height: u32, stages: Vec<StageSummary>) -> Self {
        let sum_of_medians_ms = stages.iter().map(|s| s.p50_ms).sum();
        Self {
            views,
            width,
            height,
            stages,
            sum_of_medians_ms,
        }
    }

    fn print(&self) {
        let frames = self.stages.iter().map(|s| s.frames).max().unwrap_or(0);
        let views = if self.views == 2 { "stereo, 2 x " } else { "" };
        println!(
            "\n{views}{} x {} pixels, {frames} frames",
            self.width, self.height
        );
        println!(
            "{:<30} {:<5} {:>9} {:>9} {:>9}",
            "stage", "unit", "p50 ms", "p95 ms", "max ms"
        );
        for s in &self.stages {
            println!(
                "{:<30} {:<5} {:>9.2} {:>9.2} {:>9.2}",
                s.stage,
                s.unit.name(),
                s.p50_ms,
                s.p95_ms,
                s.max_ms
            );
        }
        println!("{:<36} {:>9.2}", "sum of medians", self.sum_of_medians_ms);
    }
}

impl RunReport {
    /// The figures of `runs` with what they were measured on.
    pub(crate) fn new(
        avatar: AvatarFigures,
        performance: &Performance,
        gpu: &Gpu,
        runtime: &Runtime,
        runs: Vec<StageTable>,
        pictures: Vec<PathBuf>,
    ) -> Self {
        Self {
            avatar,
            motion: performance.name.clone(),
            motion_frames: performance.frames.len(),
            vulkan_device: gpu.info().name.clone(),
            vulkan_driver: gpu.info().driver.clone(),
            onnx_runtime: runtime.version().to_owned(),
            runs,
            pictures,
            bake: None,
        }
    }

    /// Prints the figures and where the pictures are.
    pub(crate) fn print(&self) {
        let a = &self.avatar;
        println!(
            "\navatar   {}: {} Gaussians, {} vertices",
            a.name, a.gaussians, a.vertices
        );
        println!(
            "package  {} ({:.1} MB)",
            a.package.display(),
            a.package_bytes as f64 / 1e6
        );
        println!(
            "motion   {} ({} frames at 30 Hz)",
            self.motion, self.motion_frames
        );
        println!("GPU      {} ({})", self.vulkan_device, self.vulkan_driver);
        println!("ORT      {}", self.onnx_runtime);
        for run in &self.runs {
            run.print();
        }
        println!("\npictures");
        for picture in self.pictures.iter().take(SHOWN) {
            println!("  {}", picture.display());
        }
        if let Some(more) = self.pictures.len().checked_sub(SHOWN + 1) {
            println!("  and {} more beside them", more + 1);
        }
    }
}

/// Makes sure, before minutes of work, that a file can be written to `path`.
pub(crate) fn check_writable(path: &Path) -> anyhow::Result<()> {
    if path.is_dir() {
        bail!(
            "cannot write {}: it is a folder; name a file",
            path.display()
        );
    }
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            bail!(
                "cannot write {}: there is no folder {}",
                path.display(),
                folder.display()
            )
        }
        _ => Ok(()),
    }
}

/// Writes `figures` to `path` as indented JSON.
pub(crate) fn write_json(path: &Path, figures: &impl Serialize) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(figures).context("cannot write the figures as JSON")?;
    std::fs::write(path, text + "\n").with_context(|| format!("cannot write {}", path.display()))
}
