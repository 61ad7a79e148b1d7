//! `mon3tr demo`: the main job in one command. Bakes the demo avatar if the cache has none, holds a call between three processes,
//! and leaves pictures and tables of times.

mod call;

use crate::camera::{CameraCapture, CameraOptions, OpenCamera};
use crate::commands::bake::{BakeChoices, baked_demo_avatar};
use crate::commands::rig::{RigChoices, parse_height, rigged_avatar};
use crate::device_options::{DeviceOptions, make_folder};
use crate::film::write_png;
use crate::gaze::{GazeChoice, Sight};
use crate::monado::{self, Monado};
use crate::network::Network;
use crate::performance::{MOTION_RATE, MotionOptions, Performance};
use crate::progress;
use crate::recording::TrackedRecording;
use crate::report::{RunReport, StageTable, check_writable, write_json};
use crate::scenery::{Scenery, SceneryOptions};
use crate::side_by_side;
use crate::size::{Size, Views};
use crate::stills::{RenderSettings, StillRenderer, load_avatar};
use crate::viewpoint::{Viewpoint, eyes};
use crate::window;
use anyhow::{Context, bail};
use app_session::display::Still;
use call::{Length, Shown};
use clap::ValueEnum;
use image::{RgbImage, imageops};
use renderer_splat::options::Filter;
use renderer_vulkan::gpu::Gpu;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use tracker::mediapipe::BodyBy;
use tracker::source::SourceChoice;

/// Longest call of the demo, seconds: as long as an animation may be.
const LONGEST_CALL: f64 = 20.0;

/// Shortest call before a camera, seconds: networks and connection need a moment.
const SHORTEST_CALL: f64 = 6.0;

/// Pictures of a recording that the demo tracks: those of its longest call, at 60 Hz.
const LONGEST_RECORDING: usize = 1200;

/// Places that the middle of the motion is seen from.
const VIEWS: [&str; 6] = ["front", "side", "back", "waist-up", "face", "hands"];

/// Frames drawn to measure stereo.
const STEREO_FRAMES: usize = 30;

/// What of `--camera` the demo takes: all that `send` does but standard input.
const CAMERA_HELP: &str = "Capture the motion from a camera: its number or device (0, /dev/video0), or what stands in for one: a video file or URL, or a folder of pictures";

/// Options of `demo`.
#[derive(Debug, clap::Args)]
#[command(mut_arg("camera", |camera| camera.help(CAMERA_HELP)))]
pub struct Options {
    #[command(flatten)]
    motion: MotionOptions,
    #[command(flatten)]
    camera: CameraOptions,
    #[command(flatten)]
    scenery: SceneryOptions,
    #[command(flatten)]
    bake: BakeChoices,
    /// The avatar of this splat scan of a person (.ply, .splat, .spz, .sog) instead of the demo person; it is made first, once
    #[arg(long, value_name = "FILE", conflicts_with = "gaussians")]
    scan: Option<PathBuf>,
    /// With --scan: the person's height in metres [default: 1.75]
    #[arg(long, value_name = "METRES", requires = "scan", value_parser = parse_height)]
    height: Option<f64>,
    /// Folder for the pictures; made if missing
    #[arg(long, value_name = "FOLDER", default_value = "out/demo")]
    out: PathBuf,
    /// Size of one still in pixels; what is drawn live is as large as the animation, 640 pixels at most
    #[arg(long, value_name = "WxH", default_value = "1024x1024")]
    size: Size,
    /// Where the animation is seen from: front, three-quarter, side, back, waist-up, face, hands, or EYE:TARGET:FOV in
    /// metres and degrees relative to the person, e.g. 0,1.6,2:0,1.4,0:30
    #[arg(
        long,
        value_name = "VIEW",
        default_value = "three-quarter",
        allow_hyphen_values = true
    )]
    view: Viewpoint,
    /// Let the camera of the call follow a gaze: `mouse` with --display window, a file of an eye tracker's samples, or udp:PORT, as for `receive`
    #[arg(long, value_name = "mouse|FILE|udp:PORT")]
    gaze: Option<GazeChoice>,
    /// Where the call is shown: offscreen, as pictures on disk; live in a window (drag to orbit, scroll to come closer, Escape to
    /// leave); or in a headset, xr: the active OpenXR runtime's, or a simulated one of a Monado that is started for it
    #[arg(long, value_name = "WHERE", default_value = "offscreen")]
    display: Display,
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Where the demo's call is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Display {
    Offscreen,
    Window,
    Xr,
}

/// What all pictures of one demo share.
struct Show<'a> {
    renderer: StillRenderer<'a>,
    performance: &'a Performance,
    out: &'a Path,
    setting: &'a RenderSettings,
    /// Becomes true on Ctrl-C.
    stop: &'a AtomicBool,
}

/// Runs `demo`.
pub(crate) fn run(options: &Options, device: &DeviceOptions) -> anyhow::Result<()> {
    // What may be missing comes first: baking for minutes only to learn of it would be unkind.
    options.motion.check()?;
    options.scenery.check()?;
    if let Some(gaze) = &options.gaze {
        gaze.check_no_stdin("the demo's receiver has none")?;
        // The receiver opens it for itself.
        gaze.check(match options.display {
            Display::Window => Sight::Window,
            Display::Offscreen => Sight::Offscreen,
            Display::Xr => Sight::Nothing,
        })?;
    }
    let runtime = device.runtime()?;
    // A headset's runtime says which device it is drawn on, and opens it for the receiver.
    let gpu = match options.display {
        Display::Xr => None,
        Display::Offscreen | Display::Window => Some(device.gpu()?),
    };
    let recording = options.open_camera(device)?;
    if options.display == Display::Window {
        drop(window::events(
            "leave out --display window, and demo draws pictures instead",
        )?);
        if options.json.is_some() {
            bail!("--display window leaves no figures to write: leave out --json");
        }
    } else {
        make_folder(&options.out)?;
        options.json.as_deref().map_or(Ok(()), check_writable)?;
    }
    // Before the bake, and gone when this returns.
    let monado = match options.display {
        Display::Xr if !monado::is_another_active() => Some(Monado::start()?),
        _ => None,
    };
    let package = match &options.scan {
        Some(scan) => rigged_avatar(scan, &RigChoices::of_height(options.height), device)?,
        None => baked_demo_avatar(&options.bake, device)?,
    };
    let (avatar, figures) = load_avatar(&package)?;
    let network = Network::start()?;
    // From here on Ctrl-C leaves what there is, and no temporary folder.
    let stop = network.stop_on_signal();
    let still_renderer = gpu.as_ref().map(|gpu| StillRenderer {
        gpu,
        runtime: &runtime,
        avatar: &avatar,
    });
    let performance = match (&options.camera.camera, recording, &still_renderer) {
        (None, ..) => Some(options.motion.load(&avatar)?),
        (Some(choice), Some(recording), Some(renderer)) => {
            Some(options.tracked(choice, recording, renderer, &stop)?)
        }
        // What a camera will see, or what a window or a headset alone shows of a recording.
        (Some(_), ..) => None,
    };
    // A camera has no end.
    let seconds = performance.as_ref().map_or(LONGEST_CALL, |performance| {
        (performance.frames.len() as f64 / MOTION_RATE).min(LONGEST_CALL)
    });
    // A short recording is played again.
    let seconds = match options.camera.camera {
        Some(_) => seconds.max(SHORTEST_CALL),
        None => seconds,
    };
    let shown = match options.display {
        Display::Window => Shown::Window,
        Display::Offscreen => Shown::Offscreen { seconds },
        Display::Xr => Shown::Headset {
            monado,
            length: match options.motion.count() {
                Some(frames) => Length::Frames(frames),
                None => Length::Seconds(seconds),
            },
        },
    };
    let call = call::run(options, &package, shown, &network, &stop)?;
    let (Some(performance), Some(renderer), Display::Offscreen) =
        (performance, still_renderer, options.display)
    else {
        // A window leaves no figures, and was asked for none.
        return write_json(options.json.as_deref(), &call);
    };

    let scenery =
        options
            .scenery
            .around(None, performance.start(&avatar), performance.heading())?;
    let setting = RenderSettings {
        size: options.size,
        views: Views::Mono,
        background: scenery.as_ref().map(|scenery| scenery.background.clone()),
        filter: scenery.as_ref().map_or(Filter::Dilation, Scenery::filter),
    };
    let show = Show {
        renderer,
        performance: &performance,
        out: &options.out,
        setting: &setting,
        stop: &stop,
    };
    let (stereo, stereo_picture) = show.stereo(&options.view)?;
    let mut pictures = vec![stereo_picture];
    let gpu = show.stills(&mut pictures)?;
    let mut report = RunReport::new(
        figures,
        &performance,
        &gpu,
        &runtime,
        vec![stereo],
        pictures,
    );
    report.call = Some(call);
    report.bake = Some(avatar.report.clone());
    report.background = scenery.map(|scenery| scenery.figures);
    report.print();
    write_json(options.json.as_deref(), &report)
}

impl Options {
    /// Opens the camera or recording, before a bake of minutes and a call that would wait for it. A recording is kept, to be tracked and
    /// drawn beside the avatar; of a camera, and of what a window or a headset shows, the call's sender has to have it for itself.
    fn open_camera(&self, device: &DeviceOptions) -> anyhow::Result<Option<OpenCamera>> {
        let (Some(choice), capture) = (&self.camera.camera, &self.camera.capture) else {
            return Ok(None);
        };
        if *choice == SourceChoice::Stdin {
            bail!(
                "the demo reads a recording more than once, and standard input cannot be: write it to a file first"
            );
        }
        if self.display == Display::Offscreen && !choice.is_live() {
            return OpenCamera::recorded(choice, capture, BodyBy::Full, device).map(Some);
        }
        OpenCamera::live(choice, capture, device).map(drop)?;
        Ok(None)
    }

    /// The motion of a recording, which is left drawn beside the avatar.
    fn tracked(
        &self,
        choice: &SourceChoice,
        recording: OpenCamera,
        renderer: &StillRenderer<'_>,
        stop: &AtomicBool,
    ) -> anyhow::Result<Performance> {
        let capture = CameraCapture::new(recording, renderer.avatar, None);
        let recording = TrackedRecording::track(capture, LONGEST_RECORDING, stop)?;
        go_on(stop)?;
        recording.figures.print();
        let file = self.out.join("side-by-side.webp");
        side_by_side::draw(choice, &recording, renderer, stop, &file)?;
        println!("  {}", file.display());
        go_on(stop)?;
        Performance::of(&recording.clip(renderer.avatar)?)
    }
}

impl Show<'_> {
    /// Both eyes: times over some frames, and one picture of left and right side by side.
    fn stereo(&self, viewpoint: &Viewpoint) -> anyhow::Result<(StageTable, PathBuf)> {
        let setting = RenderSettings {
            views: Views::Stereo,
            ..self.setting.clone()
        };
        let Size { width, height } = setting.size;
        let heading = self.performance.heading();
        let mut both = RgbImage::new(width * 2, height);
        let frames = self.performance.followed(self.renderer.avatar);
        let step = frames.len().div_ceil(STEREO_FRAMES).max(1);
        let stills: Vec<Still> = (frames.step_by(step))
            .map(|(motion, floor)| {
                let camera = viewpoint.camera(floor, heading, width, height);
                Still {
                    motion: motion.clone(),
                    cameras: eyes(camera, Views::Stereo),
                }
            })
            .collect();
        let bar = progress::bar("drawing both eyes", stills.len());
        let drawn = self.renderer.draw(&setting, stills, |_, pair| {
            for (picture, x) in pair.iter().zip([0, i64::from(width)]) {
                imageops::replace(&mut both, picture, x, 0);
            }
            bar.inc(1);
            go_on(self.stop)
        })?;
        bar.finish_and_clear();
        let file = self.out.join("stereo.png");
        write_png(&file, &both)?;
        Ok((drawn.times, file))
    }

    /// The middle of the motion from several named places; returns the device that drew them.
    fn stills(&self, pictures: &mut Vec<PathBuf>) -> anyhow::Result<Arc<Gpu>> {
        let mut frames = self.performance.followed(self.renderer.avatar);
        let middle = frames.len() / 2;
        let (motion, floor) = frames.nth(middle).context("the motion has no frames")?;
        let Size { width, height } = self.setting.size;
        let still = |view: &str| -> anyhow::Result<Still> {
            let viewpoint: Viewpoint = view.parse()?;
            let heading = self.performance.heading();
            Ok(Still {
                motion: motion.clone(),
                cameras: vec![viewpoint.camera(floor, heading, width, height)],
            })
        };
        let stills = VIEWS
            .into_iter()
            .map(still)
            .collect::<anyhow::Result<Vec<_>>>()?;
        let drawn = self.renderer.draw(self.setting, stills, |number, views| {
            let (name, picture) = VIEWS.get(number).zip(views.first()).context("no picture")?;
            let file = self.out.join(format!("{name}.png"));
            write_png(&file, picture)?;
            pictures.push(file);
            go_on(self.stop)
        })?;
        Ok(drawn.gpu)
    }
}

/// An error once it is time to stop.
fn go_on(stop: &AtomicBool) -> anyhow::Result<()> {
    if stop.load(Relaxed) {
        bail!("stopped before the end");
    }
    Ok(())
}
