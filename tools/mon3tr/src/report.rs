//! What a run measured, as a table for people and as JSON for programs.

use crate::performance::Performance;
use crate::scenery::SceneFigures;
use crate::size::{Size, Views};
use anyhow::{Context, bail};
use app_pipeline::profile::StageSummary;
use clap::builder::{PathBufValueParser, TypedValueParser};
use npu_runtime::Runtime;
use profile_report::AvatarFigures;
use renderer_splat::back_ends::BackEndTrial;
use renderer_splat::options::BackEnd;
use renderer_vulkan::gpu::Gpu;
use serde::Serialize;
use std::path::{Path, PathBuf};

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
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) background: Option<SceneFigures>,
    /// What the receiver of the demo's call measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) call: Option<serde_json::Value>,
    pub(crate) runs: Vec<StageTable>,
    pub(crate) pictures: Vec<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) bake: Option<serde_json::Value>,
}

/// Stage times of one kind of picture.
#[derive(Debug, Serialize)]
pub(crate) struct StageTable {
    pub(crate) views: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) splatting: Splatting,
    pub(crate) stages: Vec<StageSummary>,
    /// Sum of the stages' medians: what a frame takes when nothing overlaps.
    pub(crate) sum_of_medians_ms: f64,
}

impl StageTable {
    pub(crate) fn new(
        views: Views,
        Size { width, height }: Size,
        stages: Vec<StageSummary>,
        splatting: Splatting,
    ) -> Self {
        let sum_of_medians_ms = stages.iter().map(|s| s.times.p50_ms).sum();
        Self {
            views: views.count(),
            width,
            height,
            splatting,
            stages,
            sum_of_medians_ms,
        }
    }

    pub(crate) fn print(&self) {
        let frames = self.stages.iter().map(|s| s.times.count).max().unwrap_or(0);
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
                s.stage.name(),
                s.unit.name(),
                s.times.p50_ms,
                s.times.p95_ms,
                s.times.max_ms
            );
        }
        println!("{:<36} {:>9.2}", "sum of medians", self.sum_of_medians_ms);
        println!("splatting: {}", self.splatting);
    }
}

/// Which of the renderer's back ends drew, and how both compared on the first picture.
#[derive(Debug, Serialize)]
pub(crate) struct Splatting {
    back_end: String,
    /// Milliseconds of the first picture; absent where the device has no clock.
    tiles_ms: Option<f64>,
    quads_ms: Option<f64>,
}

impl Splatting {
    pub(crate) fn new(back_end: BackEnd, trial: Option<BackEndTrial>) -> Self {
        Self {
            back_end: back_end.to_string(),
            tiles_ms: trial.map(|trial| trial.tiles),
            quads_ms: trial.map(|trial| trial.quads),
        }
    }
}

impl std::fmt::Display for Splatting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.back_end)?;
        let Some((tiles, quads)) = self.tiles_ms.zip(self.quads_ms) else {
            return Ok(());
        };
        // The faster one drew.
        let (own, other) = (tiles.min(quads), tiles.max(quads));
        let loser = if tiles < quads { "quads" } else { "tiles" };
        write!(
            f,
            ", {own:.1} ms against {other:.1} ms by {loser}, measured on the first picture"
        )
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
            background: None,
            call: None,
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
        if let Some(scene) = &self.background {
            println!(
                "scene    {}: {} Gaussians ({})",
                scene.file.display(),
                scene.gaussians,
                scene.format
            );
        }
        println!("GPU      {} ({})", self.vulkan_device, self.vulkan_driver);
        println!("ORT      {}", self.onnx_runtime);
        if let Some(line) = self.call.as_ref().and_then(call_line) {
            println!("call     {line}");
        }
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

/// What a call came to for its viewer, of the figures that `receive` wrote.
fn call_line(call: &serde_json::Value) -> Option<String> {
    let measured = call.pointer("/drawing/measured")?;
    let number = |at: &str| measured.pointer(at)?.as_f64();
    Some(format!(
        "{:.0} ms from {} to display (95 % within {:.0} ms), {:.1} of {:.0} pictures a second",
        number("/latency/whole/p50_ms")?,
        measured.pointer("/latency/since")?.as_str()?,
        number("/latency/whole/p95_ms")?,
        number("/pictures/per_second")?,
        number("/display_hz")?
    ))
}

/// A file to write, of the one format that its name's ending tells, such as `npz`.
pub(crate) fn file_of_format(ending: &'static str) -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(move |file| {
        let is_told = (file.extension()).is_some_and(|told| told.eq_ignore_ascii_case(ending));
        is_told.then_some(file).ok_or_else(|| {
            format!("give a name that ends in .{ending}: no other format is written")
        })
    })
}

/// Makes sure, before minutes of work, that a file can be written to `path`.
pub fn check_writable(path: &Path) -> anyhow::Result<()> {
    if path.is_dir() {
        bail!(
            "cannot write {}: it is a folder; name a file",
            path.display()
        );
    }
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            bail!(
                "cannot write {}: there is no folder {}; make it first",
                path.display(),
                folder.display()
            )
        }
        _ => Ok(()),
    }
}

/// Writes `figures` to `path` as indented JSON, if there is one.
pub fn write_json(path: Option<&Path>, figures: &impl Serialize) -> anyhow::Result<()> {
    let Some(path) = path else {
        return Ok(());
    };
    let text = serde_json::to_string_pretty(figures).context("cannot write the figures as JSON")?;
    std::fs::write(path, text + "\n").with_context(|| format!("cannot write {}", path.display()))
}
