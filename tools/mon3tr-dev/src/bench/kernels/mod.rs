//! `mon3tr-dev bench kernels`: what the CPU computes for every Gaussian, each against the memory it must touch and against
//! ONNX Runtime's operators for the same.
//!
//! What is compared runs in turns in one process, so that whatever else the machine does slows both alike.

mod interpolation;
mod sessions;
mod skinning;
mod tail;
mod turns;

use super::measure::print_table;
use mon3tr::commands::bake::{BakeChoices, chosen_or_demo_avatar};
use mon3tr::device_options::DeviceOptions;
use mon3tr::report::{check_writable, write_json};
use mon3tr::stills::load_avatar;
use profile_report::AvatarFigures;
use serde::Serialize;
use sessions::Sessions;
use std::path::PathBuf;
use turns::Comparison;

/// Options of `bench kernels`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Avatar to time F_attr's tail, skinning and the networks with [default: the demo avatar, baked if the cache has none]
    #[arg(value_name = "PKG")]
    avatar: Option<PathBuf>,
    /// Runs to take the median of
    #[arg(long, value_name = "K", default_value_t = 51, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    runs: u32,
    /// Write every sample as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    #[command(flatten)]
    bake: BakeChoices,
}

#[derive(Debug, Serialize)]
struct Measured {
    threads: usize,
    avatar: AvatarFigures,
    onnx_runtime: String,
    comparisons: Vec<Comparison>,
}

/// Runs `bench kernels`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let runtime = device.runtime()?;
    let package = chosen_or_demo_avatar(options.avatar.as_deref(), &options.bake, device)?;
    let (avatar, figures) = load_avatar(&package)?;
    let mut sessions = Sessions::new(&runtime, &avatar)?;
    let mut comparisons = Vec::new();
    for gaussians in [60_000, 200_000] {
        comparisons.push(interpolation::compare(gaussians, options.runs)?);
    }
    comparisons.extend(tail::compare(&avatar, &mut sessions, options.runs)?);
    comparisons.extend(skinning::compare(&avatar, &mut sessions, options.runs)?);
    comparisons.extend(sessions.compare(options.runs)?);
    let measured = Measured {
        threads: rayon::current_num_threads(),
        avatar: figures,
        onnx_runtime: runtime.version().to_owned(),
        comparisons,
    };
    measured.print(options.runs);
    write_json(options.json.as_deref(), &measured)
}

impl Measured {
    fn print(&self, runs: u32) {
        println!(
            "{} of {} Gaussians and {} vertices; medians of {runs} runs by turns, {} threads, ONNX Runtime {}\n",
            self.avatar.name,
            self.avatar.gaussians,
            self.avatar.vertices,
            self.threads,
            self.onnx_runtime
        );
        let headings = [
            "what",
            "MB",
            "ours ms",
            "against",
            "its ms",
            "ours / its",
            "goal",
        ];
        let rows: Vec<Vec<String>> = self.comparisons.iter().map(Comparison::row).collect();
        print_table(&headings, &rows);
    }
}
