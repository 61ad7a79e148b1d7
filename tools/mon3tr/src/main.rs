//! The `mon3tr` command: builds, shows and measures avatars.

mod backdrop;
mod children;
mod commands;
mod device_options;
mod film;
mod flat;
mod gaze;
mod ground;
mod lanes;
mod moments;
mod monado;
mod network;
mod performance;
mod place;
mod progress;
mod report;
mod scenery;
mod size;
mod stills;
mod until;
mod up;
mod viewpoint;
mod window;

use clap::{Parser, Subcommand};
use commands::{apk, bake, bench, demo, inspect, netlab, profile, receive, render, send, serve};
use device_options::DeviceOptions;
use std::process::ExitCode;

/// Telepresence with pre-built Gaussian avatars: build, show and measure them.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    device: DeviceOptions,
    /// Say more: -v for what is chosen and why, -vv for everything
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    verbose: u8,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Bake the demo avatar, move it, and leave pictures and per-stage times
    Demo(demo::Options),
    /// Build the demo avatar's package from MakeHuman's data
    Bake(bake::Options),
    /// Build the receiver as a package for Meta Quest 3
    Apk(apk::Options),
    /// Time drawing and sorting on this machine
    Bench(bench::Options),
    /// Show what is in an avatar package or a Gaussian scene
    Inspect(inspect::Options),
    /// Draw an avatar that follows a motion, a Gaussian scene, or both together
    Render(render::Options),
    /// Run the server that introduces callers and keeps avatars
    Serve(serve::Options),
    /// Send a motion, as if it were captured now, to everyone who joins
    Send(send::Options),
    /// Join a call and show who is there
    Receive(receive::Options),
    /// Measure calls over networks of any quality, all on this machine
    Netlab(netlab::Options),
    /// Show where a call's milliseconds go: what each unit does, and each picture's way from capture to display
    Profile(profile::Options),
}

/// `OpenXR`'s loader says what it lacks on standard error, in several lines for each thing; whoever wants a headset is told in one.
fn quieten_openxrs_loader() {
    const LEVEL: &str = "XR_LOADER_DEBUG";
    if std::env::var_os(LEVEL).is_none() {
        // SAFETY: nobody else reads or writes the environment: there is no other thread yet.
        unsafe { std::env::set_var(LEVEL, "none") };
    }
}

fn main() -> ExitCode {
    // `mon3tr inspect PACKAGE | head` must end quietly, as other commands do, instead of panicking at the closed pipe.
    sigpipe::reset();
    let arguments = Arguments::parse();
    if arguments.verbose == 0 {
        quieten_openxrs_loader();
    }
    let level = match arguments.verbose {
        0 => log::LevelFilter::Warn,
        1 => log::LevelFilter::Info,
        _ => log::LevelFilter::Debug,
    };
    // What the WebRTC library warns of is the ordinary course of a connection being made.
    let of_webrtc = match arguments.verbose {
        0 | 1 => log::LevelFilter::Error,
        2 => log::LevelFilter::Info,
        _ => log::LevelFilter::Debug,
    };
    let mut logger = env_logger::Builder::new();
    for library in ["rtc", "webrtc"] {
        logger.filter_module(library, of_webrtc);
    }
    logger.filter_level(level).parse_default_env().init();
    let device = &arguments.device;
    let outcome = match &arguments.command {
        Command::Demo(options) => demo::run(options, device),
        Command::Apk(options) => apk::run(options),
        Command::Bake(options) => bake::run(options, device),
        Command::Bench(options) => bench::run(options, device),
        Command::Inspect(options) => inspect::run(options),
        Command::Render(options) => render::run(options, device),
        Command::Serve(options) => serve::run(options),
        Command::Send(options) => send::run(options),
        Command::Receive(options) => receive::run(options, device),
        Command::Netlab(options) => netlab::run(options),
        Command::Profile(options) => profile::run(options, device),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // One line with the whole chain of causes: what failed, why, what to do.
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
