//! How a program with these sub-commands starts and ends.

use crate::device_options::DeviceOptions;
use crate::secret_argument;
use crate::terminal::{self, PrintableLog};
use clap::Parser;
use std::process::ExitCode;

/// Options that every sub-command takes.
#[derive(Debug, clap::Args)]
pub struct SharedOptions {
    /// What draws and deforms.
    #[command(flatten)]
    pub device: DeviceOptions,
    /// Say more: -v for what is chosen and why, -vv for everything
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    verbose: u8,
}

/// Reads the command line and starts to log as `shared` of it says. To be called first in `main`, before there is another thread.
///
/// SIGPIPE stays ignored, as Rust's runtime has it: where it ended a program, whoever closes a connection while the
/// program writes to it would.
pub fn start<A: Parser>(shared: impl FnOnce(&A) -> &SharedOptions) -> A {
    leave_no_core();
    let matches = A::command().try_get_matches();
    let matches = matches.unwrap_or_else(|error| refuse(&error));
    secret_argument::hide(&matches);
    let arguments = A::from_arg_matches(&matches);
    let arguments = arguments.unwrap_or_else(|error| refuse(&error.format(&mut A::command())));
    let verbose = shared(&arguments).verbose;
    if verbose == 0 {
        quieten_openxrs_loader();
    }
    let level = match verbose {
        0 => log::LevelFilter::Warn,
        1 => log::LevelFilter::Info,
        _ => log::LevelFilter::Debug,
    };
    // What the WebRTC library takes for trouble is the ordinary course of a connection being made: an address that a relay refuses, where another one will do. Who
    // calls is told when none does.
    let of_webrtc = match verbose {
        0 => log::LevelFilter::Off,
        1 => log::LevelFilter::Error,
        2 => log::LevelFilter::Info,
        _ => log::LevelFilter::Debug,
    };
    let mut logger = env_logger::Builder::new();
    for library in ["rtc", "webrtc"] {
        logger.filter_module(library, of_webrtc);
    }
    let logger = logger.filter_level(level).parse_default_env().build();
    let most = logger.filter();
    // It fails where there is a log already; this is called once.
    if log::set_boxed_logger(Box::new(PrintableLog(logger))).is_ok() {
        log::set_max_level(most);
    }
    arguments
}

/// Ends with what is wrong with the command line, or with what it asks of the parser alone: `--help`, `--version`.
fn refuse(error: &clap::Error) -> ! {
    let typed = std::env::args_os().skip(1);
    let typed: Vec<String> = typed.map(|it| it.to_string_lossy().into_owned()).collect();
    let Some(text) = secret_argument::refusal(error, &typed).filter(|_| error.use_stderr()) else {
        error.exit()
    };
    eprintln!("{}", text.trim_end());
    std::process::exit(error.exit_code())
}

/// A program that crashes leaves no file with the keys, links and tokens that it had in memory.
fn leave_no_core() {
    #[cfg(unix)]
    {
        use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
        let bounded = Rlimit {
            current: Some(0),
            ..getrlimit(Resource::Core)
        };
        // Any process may lower this limit.
        let _ = setrlimit(Resource::Core, bounded);
    }
}

/// The exit status of a sub-command, once its error has been told.
pub fn end(outcome: anyhow::Result<()>) -> ExitCode {
    match outcome {
        Ok(()) => match terminal::failure() {
            None => ExitCode::SUCCESS,
            Some(why) => {
                eprintln!("error: not all of the output could be written: {why}");
                ExitCode::FAILURE
            }
        },
        Err(error) => {
            // One line with the whole chain of causes: what failed, why, what to do.
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// `OpenXR`'s loader says what it lacks on standard error, in several lines for each thing; a user who wants a headset is told in one.
fn quieten_openxrs_loader() {
    const LEVEL: &str = "XR_LOADER_DEBUG";
    if std::env::var_os(LEVEL).is_none() {
        // SAFETY: nothing else reads or writes the environment: there is no other thread yet.
        unsafe { std::env::set_var(LEVEL, "none") };
    }
}
