//! Options that choose a camera and how its pictures are looked at.

use crate::device_options::networks;
use anyhow::bail;
use clap::ValueEnum;
use glam::Vec2;
use motion_fit::landmarks::{Camera, USUAL_VIEW_DEGREES};
use npu_runtime::{Provider, ProviderKind, Runtime};
use std::ffi::OsString;
use std::path::PathBuf;
use tracker::custom;
use tracker::mediapipe::{self, BodyBy, HandsBy};
use tracker::models::Models;
use tracker::source::SourceChoice;

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
    pub(super) calibrate: bool,
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
    pub(super) fn load(&self, body: BodyBy, runtime: &Runtime) -> anyhow::Result<Models> {
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
    pub(super) fn camera(&self, width: u32, height: u32) -> Camera {
        Camera::of_view(Vec2::new(width as f32, height as f32), self.fov)
    }
}

fn parse_fov(text: &str) -> Result<f32, String> {
    (text.parse().ok())
        .filter(|degrees| (10.0..=150.0).contains(degrees))
        .ok_or_else(|| format!("{text} is not a field of view of 10..150 degrees"))
}
