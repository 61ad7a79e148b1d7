//! A camera as a source of motion: its pictures, the networks that look at them, and the fit to the avatar.

use crate::calibrate::Calibrating;
use crate::device_options::{DeviceOptions, networks};
use crate::notice::Notices;
use crate::preview::{HandOver, PaceMeter, Shot};
use anyhow::{Context, bail};
use clap::ValueEnum;
use glam::Vec2;
use motion_fit::landmarks::{Camera, Observation, USUAL_VIEW_DEGREES};
use motion_fit::{Fitted, MotionFit, Subject};
use npu_runtime::{Provider, ProviderKind, Runtime};
use sender::{Capture, Captured, SendError};
use serde::Serialize;
use spmm3::Avatar;
use std::collections::VecDeque;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tracker::Tracker;
use tracker::custom;
use tracker::mediapipe::{self, BodyBy, HandsBy};
use tracker::models::Models;
use tracker::source::{self, Picture, Source, SourceChoice};
use tracker::workers::StageTimes;

/// Options that choose a camera.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct CameraOptions {
    /// Capture the motion from a camera: its number or device (0, /dev/video0), or what stands in for one: a video file or URL, a folder of
    /// pictures, or - for a .y4m or MJPEG stream on standard input
    #[arg(long, value_name = "0|FILE|URL", conflicts_with_all = ["motion", "bvh_scale", "frames"])]
    pub(crate) camera: Option<SourceChoice>,
    #[command(flatten)]
    pub(crate) capture: CaptureOptions,
}

/// Options of how a camera's pictures are looked at.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct CaptureOptions {
    /// The camera's field of view along the picture's longer side, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = USUAL_VIEW_DEGREES, value_parser = parse_fov)]
    pub(crate) fov: f32,
    /// Calibrate first: stand upright before the camera for two seconds, seen from head to feet, and look calm. The camera's tilt and
    /// height, your proportions and your neutral face are held from then on
    #[arg(long)]
    calibrate: bool,
    /// Which hands are looked at: both in every picture, alternate (the left one in a picture and the right one in the next, in half of
    /// the time), or none
    #[arg(long, value_name = "WHICH", default_value = "both")]
    hands: Hands,
    /// What runs the camera's networks: cpu, xnnpack, nnapi or qnn
    #[arg(long, value_name = "PROVIDER", default_value = "cpu")]
    camera_provider: ProviderKind,
    /// A network of your own for the body: an .onnx file, with a .toml beside it that describes it (docs/models.md)
    #[arg(long, value_name = "FILE.onnx")]
    body_model: Option<PathBuf>,
    /// A network of your own for the hands
    #[arg(long, value_name = "FILE.onnx")]
    hand_model: Option<PathBuf>,
    /// A network of your own for the face
    #[arg(long, value_name = "FILE.onnx")]
    face_model: Option<PathBuf>,
}

/// Which hands are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Hands {
    Both,
    Alternate,
    None,
}

impl CameraOptions {
    /// The same choice as arguments for another process; none without a camera.
    pub(crate) fn arguments(&self) -> Option<Vec<OsString>> {
        let mut arguments = vec!["--camera".into(), self.camera.as_ref()?.to_argument()];
        arguments.extend(["--fov".into(), self.capture.fov.to_string().into()]);
        if let Some(hands) = self.capture.hands.to_possible_value() {
            arguments.extend(["--hands".into(), hands.get_name().into()]);
        }
        if self.capture.calibrate {
            arguments.push("--calibrate".into());
        }
        let provider = self.capture.camera_provider.name();
        arguments.extend(["--camera-provider".into(), provider.into()]);
        for (flag, model) in [
            ("--body-model", &self.capture.body_model),
            ("--hand-model", &self.capture.hand_model),
            ("--face-model", &self.capture.face_model),
        ] {
            if let Some(model) = model {
                arguments.extend([flag.into(), model.into()]);
            }
        }
        Some(arguments)
    }
}

impl CaptureOptions {
    /// Loads the networks: MediaPipe's, of which `body` look at the body, and the user's in place of some.
    fn load(&self, body: BodyBy, runtime: &Runtime) -> anyhow::Result<Models> {
        // ONNX Runtime always has its own kernels, and to ask for the others loads libraries.
        let all = match self.camera_provider {
            ProviderKind::Cpu => Vec::new(),
            _ => runtime.probe(),
        };
        let lacking = (all.iter())
            .find(|one| one.provider == self.camera_provider)
            .and_then(|one| one.lacking.as_deref());
        if let Some(reason) = lacking {
            let there: Vec<_> = (all.iter())
                .filter(|one| one.lacking.is_none())
                .map(|one| one.provider.name())
                .collect();
            bail!(
                "--camera-provider {} cannot be used here: {reason}; give one of {}",
                self.camera_provider.name(),
                there.join(", ")
            );
        }
        // One thread each: body, hands and face are looked at at the same time.
        let provider = self.camera_provider.with_threads(1);
        let models = mediapipe::Options {
            body,
            hands: match self.hands {
                Hands::Both => HandsBy::Each,
                Hands::Alternate => HandsBy::Alternating,
                Hands::None => HandsBy::None,
            },
            provider,
            ..mediapipe::Options::default()
        };
        let models = models.load(&networks()?, runtime)?;
        Ok(self.custom(provider).load(models, runtime)?)
    }

    /// The user's networks.
    fn custom(&self, provider: Provider) -> custom::Options {
        custom::Options {
            provider,
            body: self.body_model.clone(),
            hand: self.hand_model.clone(),
            face: self.face_model.clone(),
        }
    }

    /// The camera of pictures of that size.
    fn camera(&self, width: u32, height: u32) -> Camera {
        Camera::of_view(Vec2::new(width as f32, height as f32), self.fov)
    }
}

fn parse_fov(text: &str) -> Result<f32, String> {
    (text.parse().ok())
        .filter(|degrees| (10.0..=150.0).contains(degrees))
        .ok_or_else(|| format!("{text} is not a field of view of 10..150 degrees"))
}

/// One picture and what it showed.
#[derive(Debug)]
pub(crate) struct Tracked<'a> {
    pub(crate) picture: &'a Picture,
    pub(crate) observation: Observation,
    pub(crate) fitted: Fitted,
}

/// Median milliseconds of the camera's stages.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct CameraFigures {
    /// Pictures that were looked at.
    pub(crate) pictures: u64,
    /// Of a live source, pictures that came while another was looked at.
    pub(crate) skipped: u64,
    pub(crate) body_ms: f64,
    /// The slower hand: both have networks of their own.
    pub(crate) hands_ms: f64,
    pub(crate) face_ms: f64,
    /// All networks of a picture together: they run beside one another.
    pub(crate) networks_ms: f64,
    /// The fit and the smoothing.
    pub(crate) fit_ms: f64,
    /// From the light to the motion.
    pub(crate) latency_ms: f64,
}

/// Tracks the person before a camera.
pub(crate) struct CameraCapture {
    source: Box<dyn Source>,
    tracker: Tracker,
    fit: MotionFit,
    camera: Camera,
    view_degrees: f32,
    picture: Arc<Picture>,
    notices: Notices,
    /// Of the newest [`TIMED`] pictures: the stages', the fit's, and from the light to the motion, milliseconds.
    times: VecDeque<(StageTimes, f64, f64)>,
    last: Option<u64>,
    pictures: u64,
    skipped: u64,
    /// Until it is done.
    calibrating: Option<Calibrating>,
    pace: PaceMeter,
    /// Where what was seen is shown, if it is.
    shots: Option<Arc<HandOver<Shot>>>,
    /// For how long it captures motion for a call, from its first one on.
    length: Option<Duration>,
    began: Option<Instant>,
}

/// Pictures whose times are kept.
const TIMED: usize = 4096;

/// A camera or recording that is open, with the networks to look at it, before it is known whom it drives.
pub(crate) struct OpenCamera {
    source: Box<dyn Source>,
    tracker: Tracker,
    camera: Camera,
    view_degrees: f32,
    calibrate: bool,
}

impl OpenCamera {
    /// Opens a camera for a call: of what it gives, the newest.
    pub(crate) fn live(
        choice: &SourceChoice,
        options: &CaptureOptions,
        device: &DeviceOptions,
    ) -> anyhow::Result<Self> {
        let source = source::open_live(choice, true);
        // The larger network is too slow for a call.
        let body = BodyBy::Full;
        Self::new(source.context("cannot capture")?, options, body, device)
    }

    /// Opens a recording: every picture of it, its body looked at by the networks `body`.
    pub(crate) fn recorded(
        choice: &SourceChoice,
        options: &CaptureOptions,
        body: BodyBy,
        device: &DeviceOptions,
    ) -> anyhow::Result<Self> {
        let source = source::open(choice);
        Self::new(source.context("cannot track")?, options, body, device)
    }

    fn new(
        source: Box<dyn Source>,
        options: &CaptureOptions,
        body: BodyBy,
        device: &DeviceOptions,
    ) -> anyhow::Result<Self> {
        let runtime = device.runtime()?;
        let models = options.load(body, &runtime)?;
        let info = source.info();
        Ok(Self {
            camera: options.camera(info.width, info.height),
            view_degrees: options.fov,
            calibrate: options.calibrate,
            source,
            tracker: Tracker::new(models)?,
        })
    }
}

impl CameraCapture {
    /// Has the camera drive `avatar`; for a call of `length`, if there is one.
    pub(crate) fn new(open: OpenCamera, avatar: &Avatar, length: Option<Duration>) -> Self {
        let OpenCamera {
            source,
            tracker,
            camera,
            view_degrees,
            calibrate,
        } = open;
        Self {
            source,
            tracker,
            fit: MotionFit::new(&Subject::from(avatar), camera),
            camera,
            view_degrees,
            picture: Arc::default(),
            notices: Notices::default(),
            times: VecDeque::new(),
            last: None,
            pictures: 0,
            skipped: 0,
            calibrating: calibrate.then(|| Calibrating::new(&avatar.skeleton, camera)),
            pace: PaceMeter::default(),
            shots: None,
            length,
            began: None,
        }
    }

    /// The camera as the fit knows it.
    pub(crate) fn camera(&self) -> Camera {
        self.camera
    }

    /// Whether a calibration is wanted that is not done yet.
    pub(crate) fn is_calibrating(&self) -> bool {
        self.calibrating.is_some()
    }

    /// Has what is seen in each picture put there, too.
    pub(crate) fn show_in(&mut self, shots: Arc<HandOver<Shot>>) {
        self.shots = Some(shots);
    }

    pub(crate) fn source(&self) -> &dyn Source {
        &*self.source
    }

    /// Waits for the next picture and tracks it; nothing at the end.
    pub(crate) fn track(&mut self) -> anyhow::Result<Option<Tracked<'_>>> {
        // The networks' threads have let go of the last picture as a rule; else it is theirs.
        if Arc::get_mut(&mut self.picture).is_none() {
            self.picture = Arc::default();
        }
        let buffer = Arc::make_mut(&mut self.picture);
        if !self.source.next(buffer)? {
            return Ok(None);
        }
        let size = Vec2::new(buffer.width as f32, buffer.height as f32);
        if size != self.camera.size {
            // Its lens is the same.
            self.camera = Camera::of_view(size, self.view_degrees);
            self.fit.set_camera(self.camera);
            if let Some(calibrating) = &mut self.calibrating {
                calibrating.set_camera(self.camera);
            }
            log::info!(
                "{}: pictures are {} x {} from now on",
                self.source.info().name,
                size.x,
                size.y
            );
        }
        let picture = &self.picture;
        self.pictures += 1;
        if let Some(last) = self.last.replace(picture.number) {
            self.skipped += picture.number.saturating_sub(last + 1);
        }
        let seen = self.tracker.observe(&self.picture)?;
        let (times, people) = (seen.times, seen.people);
        let observation = seen.into_observation();
        let began = Instant::now();
        if let Some(calibrating) = &mut self.calibrating {
            let body = observation.body_landmarks();
            if calibrating.see(observation.seconds, body, &mut self.fit) {
                self.calibrating = None;
            }
        }
        let fitted = self.fit.step(&observation);
        let ended = Instant::now();
        let ms = |from: Instant| ended.saturating_duration_since(from).as_secs_f64() * 1e3;
        self.pace.count(ended, ms(picture.at));
        if self.times.len() == TIMED {
            self.times.pop_front();
        }
        self.times.push_back((times, ms(began), ms(picture.at)));
        let notice = (self.notices).after(&self.picture, fitted.sees_person, people);
        if let Some(notice) = notice {
            log::warn!("{}: {notice}", self.source.info().name);
        }
        if let Some(shots) = &self.shots {
            shots.put(Shot {
                picture: Arc::clone(&self.picture),
                observation: observation.clone(),
                fitted: fitted.clone(),
                camera: self.camera,
                pace: self.pace.pace(),
                notice: self.notices.now(),
                calibrating: self.calibrating.as_ref().map(Calibrating::state),
            });
        }
        Ok(Some(Tracked {
            picture: &self.picture,
            observation,
            fitted,
        }))
    }

    /// What the stages took.
    pub(crate) fn figures(&self) -> CameraFigures {
        let median = |of: &dyn Fn(&(StageTimes, f64, f64)) -> f64| {
            let mut values: Vec<f64> = self.times.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        };
        CameraFigures {
            pictures: self.pictures,
            skipped: self.skipped,
            body_ms: median(&|(times, _, _)| times.body_ms.into()),
            hands_ms: median(&|(times, _, _)| times.hands_ms[0].max(times.hands_ms[1]).into()),
            face_ms: median(&|(times, _, _)| times.face_ms.into()),
            networks_ms: median(&|(times, _, _)| times.total_ms.into()),
            fit_ms: median(&|(_, fit, _)| *fit),
            latency_ms: median(&|(_, _, latency)| *latency),
        }
    }
}

impl CameraFigures {
    /// The figures in a line.
    pub(crate) fn print(&self) {
        println!(
            "{} pictures, {} more skipped; median ms: body {:.1}, hands {:.1}, face {:.1}, these together {:.1}, fit {:.2}, from the light to the motion {:.1}",
            self.pictures,
            self.skipped,
            self.body_ms,
            self.hands_ms,
            self.face_ms,
            self.networks_ms,
            self.fit_ms,
            self.latency_ms,
        );
    }
}

impl Capture for CameraCapture {
    fn next(&mut self) -> Result<Option<Captured>, SendError> {
        let began = *self.began.get_or_insert_with(|| {
            // What came while the call waited for a viewer is no loss, and was not timed in a call.
            self.last = None;
            self.times.clear();
            Instant::now()
        });
        if self.length.is_some_and(|length| began.elapsed() >= length) {
            return Ok(None);
        }
        let tracked = (self.track()).map_err(|error| SendError::Capture(error.into()))?;
        Ok(tracked.map(|tracked| Captured {
            at: tracked.picture.at,
            motion: tracked.fitted.motion,
        }))
    }
}
