//! The program under test: a puppet that dances, shown in the headset that the environment names, and what that came to.

use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::control::Control;
use app_pipeline::placement::InferenceBackends;
use app_pipeline::plan::{PlacementRequest, Plan};
use app_pipeline::profile::PictureTimes;
use app_pipeline::quality::QualityMode;
use app_pipeline::timeline::LatencyMode;
use app_session::headset::{
    FrameCapture, FrameObserver, HeadsetDisplay, HeadsetHandle, PresentOptions,
};
use app_session::participant::{Origin, Participant};
use app_session::session::{Session, SessionConfig};
use renderer_openxr::error::XrError;
use renderer_openxr::headset::HeadsetOptions;
use renderer_openxr::runtime::Runtime;
use renderer_splat::error::RenderError;
use renderer_vulkan::error::VulkanError;
use renderer_vulkan::gpu::Gpu;
use serde::{Deserialize, Serialize};
use serde_json::json;
use spmm3::{Avatar, LOOP_SECONDS, MotionClip, Playback};
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use synthetic_person::Puppet;
use test_support::allocations::bytes_held;
use test_support::{onnx, vulkan};

/// By which the program is told what to do, as JSON.
pub(crate) const ORDERS: &str = "MON3TR_TEST_HEADSET";

/// The program's name among this file's tests.
pub(crate) const NAME: &str = "program::the_program_that_the_tests_here_start";

/// What there is to tell, in the folder of the orders.
pub(crate) const REPORT: &str = "report.json";

/// A file in that folder that grows while frames are shown.
pub(crate) const ALIVE: &str = "alive";

/// Motion frames a second.
const MOTION_HZ: f64 = 30.0;

/// Between two looks at the memory.
const LOOK: Duration = Duration::from_millis(500);

/// What to do.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Orders {
    /// How long frames are shown, from the first on.
    pub(crate) seconds: f64,
    /// Where report and pictures are put.
    pub(crate) folder: PathBuf,
}

/// What the process holds at one moment.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Holdings {
    /// Since the first frame.
    pub(crate) seconds: f64,
    /// All of it that is in memory, the device's too where that is software: bytes.
    pub(crate) resident: u64,
    /// Allocated by Rust code: bytes.
    pub(crate) allocated: i64,
    /// On the device, by the renderer's own count: bytes.
    pub(crate) device: u64,
    /// Open files, which images shared with the compositor are too.
    pub(crate) files: usize,
}

/// A picture, in milliseconds of one clock.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Shown {
    /// When it was to be seen.
    pub(crate) predicted: f64,
    /// The moment of motion that it shows.
    pub(crate) moment: f64,
    /// Where that is between two states.
    pub(crate) alpha: f64,
    /// Whether its Gaussians were made for it, and not for one before.
    pub(crate) fresh: bool,
}

#[test]
#[ignore = "it is a program: the tests here start it where there is a runtime"]
fn the_program_that_the_tests_here_start() {
    let Ok(orders) = std::env::var(ORDERS) else {
        println!("skipped: nobody has started it");
        return;
    };
    vulkan::log_warnings();
    let orders: Orders = serde_json::from_str(&orders).expect("orders");
    let report = obey(&orders);
    let file = orders.folder.join(REPORT);
    std::fs::write(&file, report.to_string()).expect("the report");
}

fn obey(orders: &Orders) -> serde_json::Value {
    let runtime = Runtime::load().expect("a loader");
    let (validated, headset) = open(&runtime);
    let gpu = Arc::clone(headset.headset().gpu());
    let bytes = Puppet::small().avatar().to_bytes().expect("a package");
    let avatar = Avatar::read(std::io::Cursor::new(bytes)).expect("the package is sound");
    let onnx = onnx::runtime().expect("the test that starts this has looked");
    let compiled = CompiledSources::default();
    let config = SessionConfig {
        backends: InferenceBackends {
            runtime: &onnx,
            threads: 1,
            compiled: &compiled,
        },
        placement: PlacementRequest {
            plan: Some(Plan::CpuTail),
            provider: None,
            ..PlacementRequest::default()
        },
        latency: LatencyMode::Interpolate,
        quality: QualityMode::Fixed(0),
    };
    let mut witness = Witness::new(orders, Arc::clone(&gpu));
    let present = PresentOptions {
        scene: None,
        read_back: true,
        display_hz: None,
        ..PresentOptions::default()
    };
    let mut display = HeadsetDisplay::new(headset, present, &mut witness);
    let session = Session::new(config, vec![dance(avatar)], Control::default());
    let session = session.run(&mut display).expect("it is shown");
    let figures = display.into_figures();
    let pictures = session.people[0].collector.pictures().copied().collect();
    drop(session);
    json!({
        "figures": figures,
        "validated": validated,
        "validation_messages": gpu.validation_messages(),
        "holdings": witness.holdings,
        "shown": shown(pictures),
    })
}

/// The built-in performance, again and again.
fn dance(avatar: Avatar) -> Participant {
    let clip = MotionClip::built_in(
        &avatar.skeleton,
        &avatar.expressions,
        LOOP_SECONDS,
        MOTION_HZ,
    );
    let clip = clip.expect("a motion");
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few hundred"
    )]
    let count = (LOOP_SECONDS * MOTION_HZ).round() as u32;
    let frames = (0..count)
        .map(|frame| clip.sample(f64::from(frame) / MOTION_HZ, Playback::Loop))
        .collect();
    Participant {
        avatar: Arc::new(avatar),
        sits: false,
        origin: Origin::Clip {
            frames,
            rate_hz: MOTION_HZ,
        },
    }
}

/// With Vulkan's validation layer, where there is one.
fn open(runtime: &Runtime) -> (bool, HeadsetHandle) {
    let open = |validation| {
        let options = HeadsetOptions {
            eye_size: None,
            validation,
        };
        HeadsetHandle::open(runtime.clone(), options)
    };
    match open(true) {
        Err(XrError::Render(RenderError::Vulkan(VulkanError::NoValidationLayer))) => {
            (false, open(false).expect("a headset"))
        }
        opened => (true, opened.expect("a headset")),
    }
}

/// Looks on while it is shown.
struct Witness {
    seconds: Duration,
    folder: PathBuf,
    gpu: Arc<Gpu>,
    first: Option<Instant>,
    looked: Option<Instant>,
    holdings: Vec<Holdings>,
    alive: File,
}

impl Witness {
    fn new(orders: &Orders, gpu: Arc<Gpu>) -> Self {
        Self {
            seconds: Duration::from_secs_f64(orders.seconds),
            folder: orders.folder.clone(),
            gpu,
            first: None,
            looked: None,
            // Looking takes no memory.
            holdings: Vec::with_capacity(1024),
            alive: File::create(orders.folder.join(ALIVE)).expect("a file"),
        }
    }

    fn look(&mut self) {
        let (now, first) = (Instant::now(), *self.first.get_or_insert_with(Instant::now));
        if self.looked.is_some_and(|last| now - last < LOOK) {
            return;
        }
        self.looked = Some(now);
        self.alive.write_all(b".").expect("the file");
        self.holdings.push(Holdings {
            seconds: (now - first).as_secs_f64(),
            resident: resident(),
            allocated: bytes_held(),
            device: self.gpu.memory_taken(),
            files: std::fs::read_dir("/proc/self/fd").expect("Linux").count(),
        });
    }
}

impl FrameObserver for Witness {
    fn is_over(&self, _shown: u64) -> bool {
        self.first
            .is_some_and(|first| first.elapsed() >= self.seconds)
    }

    fn wants_pictures(&mut self, shown: u64, _has_people: bool) -> bool {
        self.look();
        // One for all, once the puppet is there: reading takes time.
        shown == 60
    }

    fn captured(&mut self, frame: FrameCapture<'_>) {
        for (eye, picture) in ["left", "right"].iter().zip(frame.pictures) {
            let file = self.folder.join(format!("{eye}.png"));
            let (width, height) = (picture.width, picture.height);
            let colour = image::ColorType::Rgba8;
            image::save_buffer(file, &picture.rgba, width, height, colour).expect("a picture");
        }
    }
}

/// Bytes of this process that are in memory.
fn resident() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kilobytes = line.and_then(|line| line.split_whitespace().next());
    let kilobytes: u64 = kilobytes.and_then(|text| text.parse().ok()).expect("kB");
    kilobytes * 1024
}

/// Where each picture lies on the axis of motion, written apart from the timeline that chose it.
fn shown(pictures: Vec<PictureTimes>) -> Vec<Shown> {
    let Some(first) = pictures.first().map(|one| one.from.due) else {
        return Vec::new();
    };
    // Some are before the first.
    let at = |time: Instant| {
        let after = time.saturating_duration_since(first).as_secs_f64();
        (after - first.saturating_duration_since(time).as_secs_f64()) * 1e3
    };
    let shown = pictures.iter().map(|one| {
        let (from, to) = (at(one.from.due), at(one.to.due));
        let alpha = f64::from(one.alpha);
        Shown {
            predicted: at(one.predicted),
            moment: from + (to - from) * alpha,
            alpha,
            fresh: one.interpolated_for == one.number,
        }
    });
    shown.collect()
}
