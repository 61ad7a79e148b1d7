//! `mon3tr-dev capture check`: what a capture is like, as pages of pictures, figures and words.

use ::capture::{Camera, Capture, FramePose};
use anyhow::Context;
use capture_completion::check::{MaskFacts, Report, Shown, measured, report};
use capture_completion::draw::{Drawing, Over, draw};
use capture_completion::{Networks, OfCapture, fit_motion, look};
use mon3tr::commands::bake::{BakeChoices, chosen_or_demo_avatar};
use mon3tr::device_options::{DeviceOptions, make_folder};
use mon3tr::progress;
use mon3tr::stills::load_avatar;
use motion_fit::Subject;
use motion_fit::landmarks::Observation;
use spmm3::Skeleton;
use std::path::{Path, PathBuf};

/// Cameras and frames of a page, and the height of each picture, pixels.
const CAMERAS: usize = 6;
const ROWS: usize = 3;
const HEIGHT: usize = 540;

/// Options of `capture check`.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// The capture, in our own layout or that of AvatarReX, THuman4.0 or ActorsHQ
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// Where the pages go
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Consecutive frames that are looked at, from the middle of the capture
    #[arg(long, value_name = "COUNT", default_value = "60", value_parser = clap::value_parser!(u16).range(1..))]
    frames: u16,
    /// The avatar whose skeleton is drawn, made as long as the person [default: the demo's]
    #[arg(long, value_name = "PACKAGE")]
    avatar: Option<PathBuf>,
    #[command(flatten)]
    bake: BakeChoices,
}

pub(super) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    let capture = Capture::open(&options.folder)?;
    make_folder(&options.out)?;
    let networks = Networks::new(None, device.runtime()?)?;
    let package = chosen_or_demo_avatar(options.avatar.as_deref(), &options.bake, device)?;
    let (avatar, _) = load_avatar(&package)?;
    let frames = usize::from(options.frames).min(capture.frames());
    let first = (capture.frames() - frames) / 2;
    println!(
        "{}: {} cameras, {} frames at {:.2} Hz; frames {first} to {} are looked at",
        options.folder.display(),
        capture.cameras().len(),
        capture.frames(),
        capture.frame_rate(),
        first + frames - 1
    );
    for note in capture.notes() {
        println!("  {note}");
    }
    let mut pictures = OfCapture::new(&capture, first, frames);
    let cameras: Vec<Camera> = capture.cameras().iter().map(Camera::undistorted).collect();
    let bar = progress::bar("looking", frames * cameras.len());
    let (mut shown, mut observations) = (Vec::new(), Vec::new());
    for camera in 0..cameras.len() {
        let has_masks = capture.has_masks(camera);
        let (mut of, mut seen): (Vec<Shown>, Vec<Observation>) = (Vec::new(), Vec::new());
        look(&mut pictures, camera, &networks, &mut |look| {
            let mask = look.photograph.mask.as_ref().filter(|_| has_masks);
            of.push(Shown {
                landmarks: look.observation.body_landmarks().cloned(),
                mask: mask.map(|mask| MaskFacts::of(mask, look.photograph.size[0] as usize)),
            });
            seen.push(look.observation);
            bar.inc(1);
            Ok(())
        })?;
        shown.push(of);
        observations.push(seen);
    }
    bar.finish_and_clear();
    let subject = Subject::from(&*avatar);
    let rate = capture.frame_rate();
    let (poses, skeleton): (Vec<FramePose>, Skeleton) = match capture.poses() {
        Some(poses) => {
            let poses = poses.iter().skip(first).take(frames).cloned().collect();
            (poses, measured(&avatar.skeleton, &cameras, &shown))
        }
        None => {
            println!(
                "  there is no motion: the cameras are compared with one fitted to all of them"
            );
            let motion = fit_motion(&subject, &cameras, &observations, rate, true);
            (motion.poses, motion.skeleton)
        }
    };
    let unmasked = (0..cameras.len()).filter(|camera| !capture.has_masks(*camera));
    let unmasked = unmasked.count();
    if unmasked > 0 {
        println!(
            "  {unmasked} of {} cameras have no masks: `reconstruct` needs those of all that are not held out",
            cameras.len()
        );
    }
    print(&report(&cameras, &shown, &poses, &skeleton));
    let pages = Pages {
        capture: &capture,
        cameras: &cameras,
        shown: &shown,
        poses: &poses,
        skeleton: &skeleton,
        first,
    };
    pages.write(&options.out)
}

fn print(report: &Report) {
    println!(
        "{:<16} {:>9} {:>10} {:>8} {:>5} {:>6} {:>6}",
        "camera", "person in", "error, px", "%", "lag", "empty", "cut"
    );
    for camera in &report.cameras {
        let figure = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.1}"));
        println!(
            "{:<16} {:>4}/{:<4} {:>10} {:>8} {:>5} {:>6} {:>6}",
            camera.name,
            camera.seen,
            camera.frames,
            figure(camera.error_px),
            figure(camera.error_percent),
            camera.lag,
            camera.empty_masks,
            camera.cut_masks
        );
    }
    for finding in &report.findings {
        println!("{finding}");
    }
    if report.findings.is_empty() {
        println!("nothing is wrong that could be seen");
    }
}

struct Pages<'a> {
    capture: &'a Capture,
    cameras: &'a [Camera],
    shown: &'a [Vec<Shown>],
    poses: &'a [FramePose],
    skeleton: &'a Skeleton,
    /// Of the frames that were looked at.
    first: usize,
}

impl Pages<'_> {
    fn write(&self, out: &Path) -> anyhow::Result<()> {
        let frames = self.poses.len();
        let rows = ROWS.min(frames);
        let chosen: Vec<usize> = (0..rows)
            .map(|row| row * frames.saturating_sub(1) / (rows - 1).max(1))
            .collect();
        for (number, first) in (0..self.cameras.len()).step_by(CAMERAS).enumerate() {
            let cameras = first..(first + CAMERAS).min(self.cameras.len());
            let rows = (chosen.iter())
                .map(|frame| {
                    cameras
                        .clone()
                        .map(|camera| self.one(camera, *frame))
                        .collect()
                })
                .collect::<anyhow::Result<Vec<Vec<Drawing>>>>()?;
            let page = Drawing::page(&rows);
            let [width, height] = page.size.map(|side| u32::try_from(side).unwrap_or(0));
            let path = out.join(format!("page-{number:02}.png"));
            image::RgbImage::from_raw(width, height, page.rgb)
                .context("a page is larger than a picture may be")?
                .save(&path)
                .with_context(|| format!("cannot write {}", path.display()))?;
            println!("{}", path.display());
        }
        Ok(())
    }

    fn one(&self, camera: usize, frame: usize) -> anyhow::Result<Drawing> {
        let photograph = self.capture.photograph(camera, self.first + frame)?;
        let over = Over {
            pose: self.poses.get(frame).map(|pose| (pose, self.skeleton)),
            landmarks: (self.shown[camera].get(frame)).and_then(|shown| shown.landmarks.as_ref()),
        };
        Ok(draw(&photograph, &self.cameras[camera], over, HEIGHT))
    }
}
