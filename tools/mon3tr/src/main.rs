//! The `mon3tr` command: builds, shows and sends avatars.

use clap::Parser;
use mon3tr::commands::Command;
use mon3tr::program::{self, SharedOptions};
use std::process::ExitCode;

/// Telepresence with pre-built Gaussian avatars: build, show and send them.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    shared: SharedOptions,
}

fn main() -> ExitCode {
    let arguments: Arguments = program::start(|arguments: &Arguments| &arguments.shared);
    program::end(arguments.command.run(&arguments.shared.device))
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
