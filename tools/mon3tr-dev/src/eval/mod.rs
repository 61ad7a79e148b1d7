//! `mon3tr-dev eval`: how well parts of the system do their work, against truth that is known.

mod avatar;
mod capture;
mod fit_by;
mod footage;
mod kept;
mod motions;
mod observations;
mod renders;
mod rig;
mod score;
mod table;

use clap::Subcommand;
use mon3tr::device_options::DeviceOptions;

/// Options of `eval`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Compare an avatar with the photographs of a capture: training poses, novel poses and novel views
    Avatar(avatar::Options),
    /// Compare the motion that a camera sees with the true one: on renders of an avatar, and on real footage
    Capture(capture::Options),
    /// Compare avatars made of scans with the truth: of synthetic people, whose joints are known, and of real scans
    Rig(rig::Options),
}

/// Runs `eval`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    match &options.what {
        What::Avatar(options) => avatar::run(options, device),
        What::Capture(options) => capture::run(options, device),
        What::Rig(options) => rig::run(options, device),
    }
}
