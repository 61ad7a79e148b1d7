//! `mon3tr track`: the motion of the person in a video, as a file that other tools read.

use crate::camera::{CameraCapture, CaptureOptions, OpenCamera};
use crate::commands::bake::{BakeChoices, chosen_or_demo_avatar};
use crate::device_options::{DeviceOptions, make_folder};
use crate::network::Network;
use crate::recording::TrackedRecording;
use crate::report::{check_writable, file_of_format, write_json};
use crate::side_by_side;
use crate::stills::{StillRenderer, load_avatar};
use anyhow::{Context, bail};
use std::path::PathBuf;
use std::sync::atomic::Ordering::Relaxed;
use tracker::mediapipe::BodyBy;
use tracker::source::SourceChoice;

/// Frames of the longest video: 20 minutes at 60 Hz.
const MOST_FRAMES: usize = 72_000;

/// Options of `track`.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// A video file or its URL, a folder of pictures, or - for a .y4m or MJPEG stream on standard input; a camera is for send and demo
    #[arg(value_name = "VIDEO")]
    video: SourceChoice,
    /// The motion, as SMPL-X and AMASS write it. The folders of this and of the other files are made if missing
    #[arg(long, value_name = "FILE.npz", default_value = "motion.npz", value_parser = file_of_format("npz"))]
    out: PathBuf,
    /// The avatar whose skeleton and face are fitted [default: the demo's, baked once: one to three minutes]
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
    /// Draw the avatar beside the video, into this animation. The video is read again for it, which standard input cannot be
    #[arg(long, value_name = "FILE.webp", value_parser = file_of_format("webp"))]
    render: Option<PathBuf>,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Runs `track`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    if options.video.is_live() {
        bail!(
            "track takes recordings, and this is live: a camera or a live address drives an avatar with send --camera or demo --camera"
        );
    }
    if options.render.is_some() && matches!(options.video, SourceChoice::Stdin) {
        bail!(
            "--render reads the video a second time, and standard input cannot be: write it to a file first"
        );
    }
    // What may be missing comes before minutes of work.
    let open = OpenCamera::recorded(&options.video, &options.capture, options.body, device)?;
    let drawing = match &options.render {
        Some(file) => Some((file, device.gpu()?, device.runtime()?)),
        None => None,
    };
    for file in [
        Some(&options.out),
        options.render.as_ref(),
        options.json.as_ref(),
    ]
    .into_iter()
    .flatten()
    {
        file.parent().map_or(Ok(()), make_folder)?;
        check_writable(file)?;
    }
    let package = chosen_or_demo_avatar(options.avatar.as_deref(), &options.bake, device)?;
    let (avatar, _) = load_avatar(&package)?;
    let network = Network::start()?;
    // From here on Ctrl-C leaves what there is.
    let stop = network.stop_on_signal();
    let capture = CameraCapture::new(open, &avatar, None);
    let recording = TrackedRecording::track(capture, MOST_FRAMES, &stop)?;
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
    write_json(options.json.as_deref(), &recording.figures)?;
    if let (Some((file, gpu, runtime)), false) = (&drawing, stop.load(Relaxed)) {
        let renderer = StillRenderer {
            gpu,
            runtime,
            avatar: &avatar,
        };
        side_by_side::draw(&options.video, &recording, &renderer, &stop, file)?;
        println!("{}", file.display());
    }
    if stop.load(Relaxed) {
        bail!("stopped before the end: the files above have what there was until then");
    }
    Ok(())
}
