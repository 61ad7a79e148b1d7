//! `mon3tr profile`: a real call on this machine, and where its milliseconds go: a table, JSON, a trace and a page.

mod call;
mod watch;

use crate::commands::bake::{BakeChoices, baked_demo_avatar};
use crate::commands::send;
use crate::device_options::{DeviceOptions, compiled, inference_backends, make_folder};
use crate::flat;
use crate::lanes::LaneChoices;
use crate::network;
use crate::performance::MotionOptions;
use crate::report::check_writable;
use crate::size::{DEFAULT_SIZE, Size, Views};
use crate::stills::load_avatar;
use anyhow::{Context, bail, ensure};
use app_pipeline::control::Control;
use app_pipeline::error::in_full;
use app_pipeline::quality::QualityMode;
use app_session::display::OffscreenDisplay;
use app_session::session::Session;
use call::Room;
use profile_report::machine::{self, EVERY, Sysfs};
use profile_report::{Conditions, Files, Measured, Memory, Report, SessionTerms};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Duration;
use watch::Watch;

/// Where the person is seen from.
const CAMERA: &str = "front";

/// Options of `profile`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// The avatar's package [default: the demo avatar, baked if the cache has none]
    #[arg(value_name = "PKG")]
    package: Option<PathBuf>,
    #[command(flatten)]
    motion: MotionOptions,
    /// Motions a second
    #[arg(long, value_name = "HZ", default_value = "30", value_parser = send::parse_rate)]
    rate: f64,
    #[command(flatten)]
    lanes: LaneChoices,
    /// Give up quality where the GPU cannot hold the display's rate, as a window and a headset do
    #[arg(long)]
    hold: bool,
    /// How long to measure, after a warm-up
    #[arg(long, value_name = "SECONDS", default_value = "10", value_parser = network::parse_seconds)]
    seconds: Duration,
    /// Pictures a second that the display shows
    #[arg(long, value_name = "HZ", default_value = "72", value_parser = parse_display_hz)]
    display_hz: f64,
    /// Size of one eye's picture in pixels
    #[arg(long, value_name = "WxH", default_value_t = DEFAULT_SIZE)]
    size: Size,
    /// One eye's view instead of both
    #[arg(long)]
    mono: bool,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE", default_value = "out/profile/profile.json")]
    json: PathBuf,
    /// Write a trace for ui.perfetto.dev
    #[arg(long, value_name = "FILE", default_value = "out/profile/trace.json")]
    trace: PathBuf,
    /// Write a page for any browser
    #[arg(long, value_name = "FILE", default_value = "out/profile/profile.html")]
    page: PathBuf,
    #[command(flatten)]
    bake: BakeChoices,
}

impl Options {
    fn views(&self) -> Views {
        if self.mono {
            Views::Mono
        } else {
            Views::Stereo
        }
    }

    /// The package, and what is needed before the long part begins.
    fn package(&self, device: &DeviceOptions) -> anyhow::Result<PathBuf> {
        match &self.package {
            Some(package) => {
                ensure!(
                    package.is_file(),
                    "there is no avatar package {}: leave it out for the demo avatar, or make one with `mon3tr bake`",
                    package.display()
                );
                Ok(package.clone())
            }
            None => baked_demo_avatar(&self.bake, device),
        }
    }
}

/// Runs `profile`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    options.motion.check()?;
    for file in [&options.json, &options.trace, &options.page] {
        file.parent().map_or(Ok(()), make_folder)?;
        check_writable(file)?;
    }
    let gpu = device.gpu()?;
    let runtime = device.runtime()?;
    let package = options.package(device)?;
    let (avatar, figures) = load_avatar(&package)?;
    println!(
        "a call on this machine: a server and a sender, each a process of its own, and this receiver"
    );
    let Some(room) = Room::open(options, &package)? else {
        return Ok(());
    };
    let machine = machine::Watch::start(vec![Box::new(Sysfs::new(Path::new("/sys")))], EVERY)
        .context("cannot watch the machine's heat and clocks")?;
    let mut watch = Watch::new(options, &gpu, &room.stop)?;
    let compiled = compiled()?;
    let quality = if options.hold {
        QualityMode::Adapt
    } else {
        QualityMode::Fixed(0)
    };
    let config = (options.lanes).session(inference_backends(&runtime, &compiled), quality);
    let participants = vec![room.participant(&avatar)];
    let viewpoint = CAMERA.parse()?;
    let needs = flat::needs(
        &gpu,
        options.size,
        options.views(),
        &viewpoint,
        options.display_hz,
    );
    let session = Session::new(config, participants, Control::default())
        .run(&mut OffscreenDisplay::new(needs, None, &mut watch))?;
    let time = watch.time(session.ended)?;
    // Before anything is made of it: that takes memory too.
    let memory = Memory::now(watch.device_bytes, watch.onnx_runtime_bytes);
    let machine = machine.finish(time[0], time[1]);
    let sent = room.close()?;
    let person = session.people.first().context("there was no person")?;
    if let Some(error) = &person.error {
        bail!("the call ended: {}", in_full(error));
    }
    let call = person.call.as_ref().map(|call| call.figures.clone());
    let terms = SessionTerms {
        time,
        display_period: Duration::from_secs_f64(1.0 / options.display_hz),
        motion_hz: options.rate,
        encode: mean_encode(&sent),
    };
    let Size { width, height } = options.size;
    let report = Report {
        avatar: figures,
        conditions: Conditions {
            motion: options.motion.name().to_owned(),
            vulkan_device: gpu.info().name.clone(),
            vulkan_driver: gpu.info().driver.clone(),
            onnx_runtime: runtime.version().to_owned(),
            provider: person
                .placement
                .provider
                .map(|provider| provider.to_string()),
            width,
            height,
            views: options.views().count(),
            latency: format!("{:?}", options.lanes.latency).to_lowercase(),
            cores: cores(),
        },
        shown: Measured::of(&session, person, &terms),
        memory,
        machine,
        call,
        sent,
    };
    let (recording, terms) = terms.recording(person);
    print!("{}", report.table());
    let files = Files {
        json: options.json.clone(),
        trace: options.trace.clone(),
        page: options.page.clone(),
    };
    files.write(&report, &recording, &terms)?;
    println!("\nwritten");
    for (file, what) in [
        (
            &files.page,
            "the timeline and distributions, for any browser",
        ),
        (&files.trace, "the trace, for ui.perfetto.dev"),
        (&files.json, "every figure"),
    ] {
        println!("  {:<32} {what}", file.display());
    }
    Ok(())
}

/// What the sender needed to encode a frame.
fn mean_encode(sent: &Value) -> Option<Duration> {
    let total = sent["encode_ns"].as_u64()?;
    Some(Duration::from_nanos(
        total.checked_div(sent["encoded"].as_u64()?)?,
    ))
}

/// Threads this machine runs at once.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn parse_display_hz(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|hz| (1.0..=1000.0).contains(hz))
        .ok_or_else(|| format!("{text} is not a display's rate of 1 to 1000 pictures a second"))
}
