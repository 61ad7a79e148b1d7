//! `mon3tr-dev capture`: folders of calibrated pictures of a person.

mod synthesise;

use clap::Subcommand;

/// Options of `capture`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Make a test capture whose truth is known: the demo person with simulated cloth, drawn by a rasteriser of its own
    Synthesise(synthesise::Options),
}

/// Runs `capture`.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    match &options.what {
        What::Synthesise(options) => synthesise::run(options),
    }
}
