//! `mon3tr-dev soak`: a long call, and whether it takes more and more: memory, descriptors, threads, time.
//!
//! Server, sender and receiver are the programs that a user has, each a process of its own: they are looked at from outside. What only the
//! receiver knows of its pictures it writes itself (`receive --samples`).

mod call;
mod judgement;
mod person;
mod sample;
mod schedule;

use anyhow::{Context, bail};
use call::Call;
use judgement::{Row, rows, table};
use mon3tr::commands::bake::{BakeChoices, chosen_or_demo_avatar};
use mon3tr::device_options::{DeviceOptions, make_folder};
use mon3tr::network::Network;
use mon3tr::report::write_json;
use person::Person;
use sample::Sample;
use schedule::Schedule;
use serde::Serialize;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// From one look at the call to the next: as often as the receiver writes its samples.
const EVERY: Duration = Duration::from_secs(2);

/// Between two looks whether it is time for something.
const LOOK: Duration = Duration::from_millis(50);

/// How long it may take until people are shown: networks are loaded and placements measured before.
const PATIENCE: Duration = Duration::from_mins(3);

/// Looks at people shown by which the headset is taken to be back: the first may be of pictures from before.
const AGAIN: u32 = 2;

/// Options of `soak`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// How long the call takes
    #[arg(long, value_name = "MINUTES", default_value = "60", value_parser = parse_minutes)]
    minutes: Duration,
    /// The avatar's package [default: the demo avatar, baked if the cache has none]
    #[arg(long, value_name = "PACKAGE")]
    avatar: Option<PathBuf>,
    #[command(flatten)]
    bake: BakeChoices,
    /// A .bvh or SMPL-X/AMASS .npz file, again and again [default: one of the built-in motion]
    #[arg(long, value_name = "FILE")]
    motion: Option<PathBuf>,
    /// Say what is in this WAV file (48 kHz), again and again [default: syllables]
    #[arg(long, value_name = "FILE.wav")]
    voice: Option<PathBuf>,
    /// Share of packets lost, each way: 0.05 is 5 %
    #[arg(long, value_name = "SHARE", default_value = "0.02")]
    loss: f64,
    /// Folder for samples, table and logs; made if missing
    #[arg(long, value_name = "FOLDER", default_value = "out/soak")]
    out: PathBuf,
}

/// What `soak.json` has.
#[derive(Debug, Serialize)]
struct Report<'a> {
    minutes: f64,
    /// What is compared, seconds since the call was live.
    windows: [[f64; 2]; 2],
    /// When the headset's runtime was killed.
    restarts: Vec<f64>,
    rows: &'a [Row],
}

/// Runs `soak`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    if cfg!(not(target_os = "linux")) {
        bail!("a call is looked at from outside by what Linux tells of processes: run it on Linux");
    }
    make_folder(&options.out)?;
    let avatar = chosen_or_demo_avatar(options.avatar.as_deref(), &options.bake, device)?;
    let person = Person::open(
        &avatar,
        options.motion.as_deref(),
        options.voice.as_deref(),
        &options.out,
    )?;
    let network = Network::start()?;
    let stop = network.stop_on_signal();
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let mut call = Call::begin(&network, &person, options.loss, folder.path(), &options.out)?;
    wait_until_live(&mut call, &stop)?;
    let schedule = Schedule::of(options.minutes);
    let seconds = |time: Duration| time.as_secs_f64();
    println!(
        "the call is live: {:.1} minutes, {} % of packets lost each way, the headset's runtime killed after {:.0} and {:.0} s",
        seconds(schedule.length) / 60.0,
        options.loss * 100.0,
        seconds(schedule.restarts[0]),
        seconds(schedule.restarts[1])
    );
    let samples = watch(
        &mut call,
        &schedule,
        &options.out.join("samples.csv"),
        &stop,
    )?;
    let outcome = call.end()?;
    let rows = rows(&samples, &schedule, outcome);
    println!(
        "\n{:.0} to {:.0} s of the call against {:.0} to {:.0} s",
        seconds(schedule.first.start),
        seconds(schedule.first.end),
        seconds(schedule.last.start),
        seconds(schedule.last.end)
    );
    for line in table(&rows) {
        println!("{line}");
    }
    let report = Report {
        minutes: seconds(schedule.length) / 60.0,
        windows: [&schedule.first, &schedule.last].map(|time| [time.start, time.end].map(seconds)),
        restarts: schedule.restarts.map(seconds).to_vec(),
        rows: &rows,
    };
    write_json(Some(&options.out.join("soak.json")), &report)?;
    println!("\nwritten\n  {}", options.out.join("samples.csv").display());
    println!("  {}", options.out.join("soak.json").display());
    match rows.iter().filter(|row| row.good == Some(false)).count() {
        0 => Ok(()),
        failing => bail!("the call did not stay as it was: {failing} lines of the table fail"),
    }
}

fn wait_until_live(call: &mut Call<'_>, stop: &AtomicBool) -> anyhow::Result<()> {
    let begun = Instant::now();
    while !call.is_live()? {
        if stop.load(Relaxed) {
            bail!("stopped before anybody was shown");
        }
        if begun.elapsed() > PATIENCE {
            bail!(
                "nobody was shown in {} s: what the receiver says is in receive.log",
                PATIENCE.as_secs()
            );
        }
        std::thread::sleep(LOOK);
    }
    Ok(())
}

/// Looks at the call to its end, and restarts the headset's runtime meanwhile. Samples are written as they come.
fn watch(
    call: &mut Call<'_>,
    schedule: &Schedule,
    file: &Path,
    stop: &AtomicBool,
) -> anyhow::Result<Vec<Sample>> {
    let cannot = || format!("cannot write {}", file.display());
    let mut csv = BufWriter::new(File::create(file).with_context(cannot)?);
    writeln!(csv, "{}", Sample::heading()).with_context(cannot)?;
    let begun = Instant::now();
    let mut samples = Vec::new();
    let mut next = EVERY;
    let mut restarts = schedule.restarts.iter();
    let mut kill = restarts.next();
    let mut back = None;
    let mut looks_since = AGAIN;
    let mut failed = false;
    while begun.elapsed() < schedule.length {
        if stop.load(Relaxed) {
            bail!(
                "stopped before the end: what was seen until then is in {}",
                file.display()
            );
        }
        let now = begun.elapsed();
        // Not before the headset has shown people again.
        if looks_since >= AGAIN && kill.is_some_and(|at| now >= *at) {
            call.kill_runtime();
            kill = restarts.next();
            back = Some(now + schedule.away);
            looks_since = 0;
        }
        if back.is_some_and(|at| now >= at) {
            call.restart_runtime()?;
            back = None;
        }
        if now >= next {
            let sample = call.look(now)?;
            // A disk that fills up in the call's last minute takes nothing from the table.
            let written = writeln!(csv, "{}", sample.line()).and_then(|()| csv.flush());
            if let (Err(error), false) = (written, failed) {
                log::warn!("{}: not all samples are kept: {error}", file.display());
                failed = true;
            }
            looks_since += u32::from(sample.runtime && sample.shown.is_some());
            samples.push(sample);
            next += EVERY;
        }
        std::thread::sleep(LOOK);
    }
    Ok(samples)
}

/// A number of minutes from half a one to a day's.
fn parse_minutes(text: &str) -> Result<Duration, String> {
    text.parse::<f64>()
        .ok()
        .filter(|minutes| (0.5..=1440.0).contains(minutes))
        .map(|minutes| Duration::from_secs_f64(minutes * 60.0))
        .ok_or_else(|| format!("{text} is not a number of minutes from 0.5 to 1440"))
}
