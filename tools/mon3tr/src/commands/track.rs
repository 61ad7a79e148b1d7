//! `mon3tr track`: the motion of the person in a video, as a file that other tools read.

use crate::camera::{CameraCapture, CaptureOptions, OpenCamera};
use crate::commands::bake::{BakeChoices, chosen_or_demo_avatar};
use crate::device_options::{DeviceOptions, make_folder};
use crate::recording::TrackedRecording;
use crate::report::{check_writable, write_json};
use crate::side_by_side;
use crate::stills::load_avatar;
use anyhow::{Context, bail};
use std::path::PathBuf;
use tracker::mediapipe::BodyBy;
use tracker::source::SourceChoice;

/// Frames of the longest video: 20 minutes at 60 Hz.
const MOST_FRAMES: usize = 72_000;

/// Options of `track`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// A video file, a folder of pictures, or - for a .y4m or MJPEG stream on standard input
    #[arg(value_name = "VIDEO")]
    video: SourceChoice,
    /// The motion, as SMPL-X and AMASS write it
    #[arg(long, value_name = "FILE.npz", default_value = "motion.npz")]
    out: PathBuf,
    /// The avatar whose skeleton and face are fitted [default: the demo's]
    #[arg(long, value_name = "PACKAGE")]
    avatar: Option<PathBuf>,
    #[command(flatten)]
    bake: BakeChoices,
    #[command(flatten)]
    capture: CaptureOptions,
    /// Which networks see the body: full (the one of a live camera), heavy (four times as slow), or both and their mean. ./run fetches the heavy one (52 MB) when it
    /// is asked for
    #[arg(long, value_name = "full|heavy|both", default_value = BodyBy::Full.name(), conflicts_with = "body_model")]
    body: BodyBy,
    /// Draw the avatar beside the video, into this animation
    #[arg(long, value_name = "FILE.webp")]
    render: Option<PathBuf>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Runs `track`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    if options.video.is_live() {
        bail!(
            "track takes recordings: a camera drives an avatar with send --camera or demo --camera"
        );
    }
    if options.render.is_some() && matches!(options.video, SourceChoice::Stdin) {
        bail!(
            "--render reads the video a second time, and standard input cannot be: write it to a file first"
        );
    }
    for file in [
        Some(&options.out),
        options.render.as_ref(),
        options.json.as_ref(),
    ]
    .into_iter()
    .flatten()
    {
        if let Some(folder) = file.parent() {
            make_folder(folder)?;
        }
        check_writable(file)?;
    }
    // Before a bake of minutes.
    let open = OpenCamera::recorded(&options.video, &options.capture, options.body, device)?;
    let package = chosen_or_demo_avatar(options.avatar.as_deref(), &options.bake, device)?;
    let (avatar, _) = load_avatar(&package)?;
    let capture = CameraCapture::new(open, &avatar, None);
    let recording = TrackedRecording::track(capture, MOST_FRAMES)?;
    if recording.seen.len() == MOST_FRAMES {
        log::warn!("only the first {MOST_FRAMES} pictures are tracked");
    }
    let clip = recording.clip(&avatar)?;
    let bytes = clip.to_npz(&avatar.skeleton)?;
    std::fs::write(&options.out, bytes)
        .with_context(|| format!("cannot write {}", options.out.display()))?;
    println!(
        "{}: {} frames at {:.3} Hz, a person in {} of {} pictures",
        options.out.display(),
        clip.frames.len(),
        clip.frame_seconds.recip(),
        recording.with_person(),
        recording.seen.len(),
    );
    recording.figures.print();
    if let Some(file) = &options.render {
        side_by_side::draw(&options.video, &recording, &avatar, device, file)?;
        println!("{}", file.display());
    }
    write_json(options.json.as_deref(), &recording.figures)
}
