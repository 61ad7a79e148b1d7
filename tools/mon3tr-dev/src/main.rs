//! The `mon3tr-dev` command: every sub-command of `mon3tr`, `serve` with all that an operator may want of it, and what only developers
//! need. A program of its own, so that the first picture does not wait for what it is built from.

#![forbid(unsafe_code)]

// In the place of the standard library's macros, which panic where the reader of the output is gone.
#[macro_use(print, println, eprintln)]
extern crate mon3tr;

mod apk;
mod audience;
mod bench;
mod canary;
mod capture;
mod eval;
mod netlab;
mod reconstruct;
mod soak;
mod usage;

use clap::{Parser, Subcommand};
#[cfg(unix)]
use mon3tr::commands::serve::{forwarder, relay};
use mon3tr::program::{self, SharedOptions};
use std::process::ExitCode;

/// Telepresence with pre-built Gaussian avatars: `mon3tr` with what developers and operators need besides.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    shared: SharedOptions,
}

#[derive(Debug, Subcommand)]
enum Command {
    #[command(flatten)]
    Shared(mon3tr::commands::Command),
    /// Build the receiver as a package for Meta Quest 3
    Apk(apk::Options),
    /// Forward one sender to many viewers, who join by a link of their own
    Audience(audience::Options),
    /// Time drawing and sorting on this machine
    Bench(bench::Options),
    /// Hold a call through a running server, and say whether it works, or which step fails
    Canary(canary::Options),
    /// Captures of a person: imported from videos, made up for tests, looked at
    Capture(capture::Options),
    /// Measure against the truth: a camera's motion, avatars of scans, avatars of pictures
    Eval(eval::Options),
    /// Forward to the viewers of a server on this machine, in a process of its own
    #[cfg(unix)]
    Forwarder(forwarder::Options),
    /// Measure calls over networks of any quality, all on this machine
    Netlab(netlab::Options),
    /// Train an avatar from a capture's pictures
    Reconstruct(reconstruct::Options),
    /// Relay the calls of a server that find no direct way, in a process of its own
    #[cfg(unix)]
    Relay(relay::Options),
    /// Hold a long call on this machine, and tell whether it takes more and more: memory, descriptors, threads, time
    Soak(soak::Options),
}

fn main() -> ExitCode {
    let arguments: Arguments = program::start(|arguments: &Arguments| &arguments.shared);
    let device = &arguments.shared.device;
    program::end(match &arguments.command {
        Command::Shared(command) => command.run(device),
        Command::Apk(options) => apk::run(options),
        Command::Audience(options) => audience::run(options),
        Command::Bench(options) => bench::run(options, device),
        Command::Canary(options) => canary::run(options),
        Command::Capture(options) => capture::run(options, device),
        Command::Eval(options) => eval::run(options, device),
        #[cfg(unix)]
        Command::Forwarder(options) => forwarder::run(options),
        Command::Netlab(options) => netlab::run(options),
        Command::Reconstruct(options) => reconstruct::run(options, device),
        #[cfg(unix)]
        Command::Relay(options) => relay::run(options),
        Command::Soak(options) => soak::run(options, device),
    })
}

#[cfg(test)]
mod tests {
    use super::Arguments;
    use clap::CommandFactory;

    #[test]
    fn no_two_options_of_a_sub_command_clash() {
        Arguments::command().debug_assert();
    }
}
