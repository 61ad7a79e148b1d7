//! `mon3tr-dev capture synthesise`: a test capture whose truth is known.

use anyhow::Context;
use capture_synthesis::noise::Noise;
use capture_synthesis::performance;
use capture_synthesis::ring::Ring;
use capture_synthesis::synthesise::{Progress, SynthesisOptions, synthesise};
use indicatif::ProgressBar;
use mon3tr::device_options::{make_folder, makehuman};
use mon3tr::progress::bar;
use mon3tr::size::Size;
use reconstruct::Person;
use spmm3::{ExpressionBasis, LoadOptions, MotionClip};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How often a step tells how far it is where standard error is no terminal.
const TOLD_EVERY: Duration = Duration::from_secs(10);

/// One camera in so many is held out.
const HELD_OUT_SHARE: usize = 6;

/// Options of `capture synthesise`.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// The folder that becomes the capture
    #[arg(short, long, value_name = "FOLDER")]
    out: PathBuf,
    /// A motion, .bvh or .npz; may be given several times. The last of several is held out [default: the built-in one and two sampled ones]
    #[arg(long, value_name = "FILE")]
    motion: Vec<PathBuf>,
    /// Cameras on the ring
    #[arg(long, value_name = "N", default_value = "12")]
    cameras: usize,
    /// Size of every picture, pixels
    #[arg(long, value_name = "WxH", default_value = "512x512")]
    size: Size,
    /// Frames of each motion, spread evenly over it
    #[arg(long, value_name = "N", default_value = "60")]
    frames: usize,
    /// Frames of the motion that is held out [default: two thirds of the others']
    #[arg(long, value_name = "N")]
    held_out_frames: Option<usize>,
    /// Cameras that are held out [default: one in six]
    #[arg(long, value_name = "N")]
    held_out_cameras: Option<usize>,
    /// The person turns once in each motion that is not held out: a single camera sees every side
    #[arg(long)]
    turn: bool,
    /// From the person to each camera, metres
    #[arg(long, value_name = "METRES", default_value = "3")]
    radius: f64,
    /// Behind the person, red,green,blue of 0 to 255
    #[arg(long, value_name = "R,G,B", default_value = "92,98,104", value_parser = colour)]
    background: [u8; 3],
    /// Errors of the written calibration: standard deviation, millimetres, of where a camera is and of where it looks
    #[arg(long, value_name = "MM", default_value = "0")]
    calibration_noise: f64,
    /// Errors of the written motion: standard deviation of every joint, degrees
    #[arg(long, value_name = "DEGREES", default_value = "0")]
    pose_noise: f64,
    /// Of the errors' random numbers
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
}

fn colour(text: &str) -> Result<[u8; 3], String> {
    let values: Vec<u8> = (text.split(','))
        .filter_map(|value| value.trim().parse().ok())
        .collect();
    <[u8; 3]>::try_from(values)
        .map_err(|_| format!("{text} is not red,green,blue, each 0 to 255, e.g. 92,98,104"))
}

pub(super) fn run(options: &Options) -> anyhow::Result<()> {
    let began = Instant::now();
    make_folder(&options.out)?;
    let makehuman = makehuman()?;
    let building = bar("building the person", 1);
    let person = Person::demo(&makehuman, |step| log::debug!("{step}"))
        .context("cannot build the demo person")?;
    building.finish_and_clear();
    let clips = clips(options, &person)?;
    let default_held_out = (options.cameras / HELD_OUT_SHARE).max(usize::from(options.cameras > 1));
    let synthesis = SynthesisOptions {
        ring: Ring {
            cameras: options.cameras,
            size: [options.size.width, options.size.height],
            radius: options.radius,
        },
        frames: options.frames,
        held_out_frames: (options.held_out_frames).unwrap_or((options.frames * 2).div_ceil(3)),
        held_out_cameras: options.held_out_cameras.unwrap_or(default_held_out),
        turn: options.turn,
        background: options.background,
        noise: Noise {
            calibration_mm: options.calibration_noise,
            pose_degrees: options.pose_noise,
            seed: options.seed,
        },
    };
    let bars = Bars::default();
    let made = synthesise(&options.out, &person, &clips, &synthesis, &bars);
    bars.replace(None);
    let made = made.context("cannot make the capture")?;
    let names: Vec<&str> = clips.iter().map(|clip| clip.name.as_str()).collect();
    println!(
        "{}: {} cameras x {} frames of {}, in {:.0} s; held out: {} cameras, {} frames; the truth is in truth.json and truth/",
        options.out.display(),
        made.cameras,
        made.frames,
        names.join(", "),
        began.elapsed().as_secs_f64(),
        made.held_out.cameras.len(),
        made.held_out.frames.len(),
    );
    Ok(())
}

/// The motions' files, or those that are made.
fn clips(options: &Options, person: &Person) -> anyhow::Result<Vec<MotionClip>> {
    if options.motion.is_empty() {
        return performance::built_in(person).context("cannot make the built-in motions");
    }
    (options.motion.iter())
        .map(|file| {
            let mut clip = MotionClip::load(file, person.skeleton(), &LoadOptions::default())
                .with_context(|| format!("cannot use the motion {}", file.display()))?;
            if let Some(line) = clip.fit_expression(&ExpressionBasis::MAKEHUMAN_1, person.presets())
            {
                println!("{}: {line}", clip.name);
            }
            Ok(clip)
        })
        .collect()
}

/// One bar per step.
#[derive(Debug, Default)]
struct Bars(Mutex<Option<(ProgressBar, Instant)>>);

impl Bars {
    fn replace(&self, next: Option<ProgressBar>) {
        let mut current = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let next = next.map(|bar| (bar, Instant::now()));
        if let Some((done, _)) = std::mem::replace(&mut *current, next) {
            done.finish_and_clear();
        }
    }
}

impl Progress for Bars {
    fn begin(&self, step: &'static str, total: usize) {
        self.replace(Some(bar(step, total)));
    }

    fn advance(&self) {
        let mut current = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((bar, told)) = current.as_mut() else {
            return;
        };
        bar.inc(1);
        if told.elapsed() >= TOLD_EVERY && !std::io::stderr().is_terminal() {
            let length = bar.length().unwrap_or_default();
            eprintln!("{}: {} of {length}", bar.message(), bar.position());
            *told = Instant::now();
        }
    }
}
