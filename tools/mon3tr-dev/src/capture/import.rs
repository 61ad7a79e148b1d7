//! `mon3tr-dev capture import`: videos of cameras that stand still, as a capture.

use ::capture::HeldOut;
use anyhow::{Context, ensure};
use capture_completion::{Networks, Pictures, Videos, complete};
use mon3tr::commands::bake::{BakeChoices, chosen_or_demo_avatar};
use mon3tr::device_options::DeviceOptions;
use mon3tr::progress;
use mon3tr::stills::load_avatar;
use motion_fit::Subject;
use motion_fit::body::several::Sight;
use std::path::PathBuf;

/// Options of `capture import`.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// A folder with a Qualisys calibration (*.qca.txt) and a video for each camera, named as its serial; or a single video
    #[arg(value_name = "VIDEOS")]
    videos: PathBuf,
    /// The capture's folder
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Field of view along the longer side of a single video, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = f64::from(motion_fit::landmarks::USUAL_VIEW_DEGREES))]
    fov: f64,
    /// Take one picture of so many
    #[arg(long, value_name = "COUNT", default_value = "1", value_parser = clap::value_parser!(u16).range(1..))]
    every: u16,
    /// Keep this camera's pictures away from training, to measure on them, though they count for the motion; may be given several times
    #[arg(long, value_name = "CAMERA")]
    hold_out_camera: Vec<String>,
    /// Keep one frame of so many away from training, to measure on them
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(2..))]
    hold_out_every: Option<u16>,
    /// The avatar whose skeleton and face are fitted [default: the demo's]
    #[arg(long, value_name = "PACKAGE")]
    avatar: Option<PathBuf>,
    #[command(flatten)]
    bake: BakeChoices,
}

pub(super) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    let networks = Networks::new(None, device.runtime()?)?;
    let videos = if options.videos.is_dir() {
        Videos::calibrated(&options.videos)?
    } else {
        Videos::single(&options.videos, options.fov)?
    };
    let mut videos = videos.every(usize::from(options.every));
    for note in &videos.notes {
        println!("{note}");
    }
    let names: Vec<&str> = (videos.cameras().iter())
        .map(|camera| camera.name.as_str())
        .collect();
    let held_out = held_out(options, &names, videos.frames())?;
    // Minutes of a bake come after what may be wrong with the videos.
    let package = chosen_or_demo_avatar(options.avatar.as_deref(), &options.bake, device)?;
    let (avatar, _) = load_avatar(&package)?;
    let count = videos.cameras().len() * videos.frames();
    let bar = progress::bar("importing", count);
    let subject = Subject::from(&*avatar);
    let done = complete(
        &mut videos,
        &subject,
        &networks,
        &options.out,
        &held_out,
        &mut |_, _| {
            bar.inc(1);
        },
    )
    .with_context(|| format!("cannot make a capture of {}", options.videos.display()))?;
    bar.finish_and_clear();
    println!(
        "{}: {} cameras, {} frames at {:.2} Hz; a person in {} of {count} pictures",
        options.out.display(),
        videos.cameras().len(),
        videos.frames(),
        videos.frame_rate(),
        (done.observations.iter().flatten())
            .filter(|seen| seen.body_landmarks().is_some())
            .count()
    );
    for (sight, words) in [
        (
            Sight::Doubtful,
            "by one camera, or by several that do not agree: their depth is less sure",
        ),
        (
            Sight::Unseen,
            "by no camera: their pose is between those before and after",
        ),
    ] {
        let frames = done.motion.frames_of(sight);
        if frames > 0 {
            println!("the person is seen in {frames} frames {words}");
        }
    }
    println!(
        "look at it: mon3tr-dev capture check {} --out PAGES",
        options.out.display()
    );
    Ok(())
}

/// What the options keep away from training, of cameras of these names and so many frames.
fn held_out(options: &Options, cameras: &[&str], frames: usize) -> anyhow::Result<HeldOut> {
    let mut held = HeldOut::default();
    for name in &options.hold_out_camera {
        let at = cameras.iter().position(|camera| camera == name);
        let at = at.with_context(|| {
            format!(
                "--hold-out-camera {name}: the cameras are {}",
                cameras.join(", ")
            )
        })?;
        held.cameras.push(at);
    }
    held.cameras.sort_unstable();
    held.cameras.dedup();
    ensure!(
        held.cameras.len() < cameras.len(),
        "--hold-out-camera leaves no camera for training"
    );
    if let Some(every) = options.hold_out_every.map(usize::from) {
        // From the middle of the first stretch on, so that training frames surround each of them.
        held.frames = (every / 2..frames).step_by(every).collect();
        ensure!(
            !held.frames.is_empty(),
            "--hold-out-every {every} holds no frame out: there are {frames}"
        );
    }
    Ok(held)
}
