//! `mon3tr-dev capture`: folders of calibrated pictures of a person, from which avatars are reconstructed: imported from videos, made up
//! for tests, and looked at.

mod align;
mod check;
mod import;
mod synthesise;

use clap::Subcommand;
use mon3tr::device_options::DeviceOptions;

/// Options of `capture`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Turn a capture's cameras, and bend the poses of all its frames, until they meet the outlines of its masks
    Align(align::Options),
    /// Show frames with skeleton and mask over them, reprojection errors, and what is wrong with a capture, in words
    Check(check::Options),
    /// Make a capture of videos: pictures, masks and motion in our own layout
    Import(import::Options),
    /// Make a test capture whose truth is known: the demo person with simulated cloth, drawn by a rasteriser of its own
    Synthesise(synthesise::Options),
}

/// Runs `capture`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    match &options.what {
        What::Align(options) => align::run(options),
        What::Check(options) => check::run(options, device),
        What::Import(options) => import::run(options, device),
        What::Synthesise(options) => synthesise::run(options),
    }
}
