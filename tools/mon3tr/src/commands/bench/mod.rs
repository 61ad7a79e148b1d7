//! `mon3tr bench`: how long drawing and sorting take on this machine, as tables for `docs/performance.md` and as JSON.

mod figure;
mod growth;
mod measure;
mod render;
mod scene;
mod sort;
mod standard;
mod traffic;

use crate::surroundings::Surroundings;
use clap::Subcommand;
pub(crate) use measure::median;

/// Options of `bench`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Time each stage of drawing: a made-up person of 30k to 1M Gaussians, or a scene of your own
    Render(render::Options),
    /// Time the depth sort by itself, from 20k to 4M keys
    Sort(sort::Options),
}

/// Runs `bench`.
pub(crate) fn run(options: &Options, surroundings: &Surroundings) -> anyhow::Result<()> {
    let gpu = surroundings.gpu()?;
    match &options.what {
        What::Render(options) => render::run(options, &gpu),
        What::Sort(options) => sort::run(options, &gpu),
    }
}
