//! The program under test: a puppet that dances, shown in the headset that the environment names, and what that came to.

use app_pipeline::concealment::ConcealmentState;
use app_pipeline::control::Control;
use app_pipeline::lanes::{LaneOptions, Lanes, MotionSource, Pose};
use app_pipeline::placement::{InferenceBackends, Placed, place};
use app_pipeline::plan::{PlacementRequest, Plan};
use app_pipeline::profile::PictureTimes;
use app_pipeline::quality::QualityMode;
use app_pipeline::timeline::LatencyMode;
use app_session::headset::{FrameObserver, PresentConfig, Seen, show};
use app_session::overlay::OverlayWatch;
use glam::Vec3;
use renderer_openxr::error::XrError;
use renderer_openxr::headset::{Headset, HeadsetOptions};
use renderer_openxr::runtime::Runtime;
use renderer_openxr::session::SessionOptions;
use renderer_splat::camera::Camera;
use renderer_splat::error::RenderError;
use renderer_splat::options::RendererOptions;
use renderer_splat::renderer::SplatRenderer;
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

/// Gaussians beside the puppet's: its shadow.
const BESIDE: u32 = 256;

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
    let (options, headset) = open(&runtime);
    let validated = options.validation;
    let gpu = Arc::clone(headset.gpu());
    let bytes = Puppet::small().avatar().to_bytes().expect("a package");
    let avatar = Avatar::read(std::io::Cursor::new(bytes)).expect("the package is sound");
    let avatar = Arc::new(avatar);
    let (mut lanes, overlay) = lanes(&headset, &avatar);
    let mut witness = Witness::new(orders, Arc::clone(&gpu));
    let showing = PresentConfig {
        runtime,
        options,
        session: SessionOptions {
            room: false,
            read_back: true,
            display_hz: None,
        },
        skeletons: vec![avatar.skeleton.clone()],
        overlay,
        control: Control::default(),
    };
    let figures = show(&mut lanes, headset, showing, &mut witness).expect("it is shown");
    let pictures = lanes.collector().pictures().copied().collect();
    drop(lanes);
    json!({
        "figures": figures,
        "validated": validated,
        "validation_messages": gpu.validation_messages(),
        "holdings": witness.holdings,
        "shown": shown(pictures),
    })
}

/// With Vulkan's validation layer, where there is one.
fn open(runtime: &Runtime) -> (HeadsetOptions, Headset) {
    let mut options = HeadsetOptions {
        eye_size: None,
        validation: true,
    };
    let headset = match Headset::open(runtime, options) {
        Err(XrError::Render(RenderError::Vulkan(VulkanError::NoValidationLayer))) => {
            options.validation = false;
            Headset::open(runtime, options)
        }
        opened => opened,
    };
    (options, headset.expect("a headset"))
}

/// Lanes for the headset, and what tells of them on the panel.
fn lanes(headset: &Headset, avatar: &Arc<Avatar>) -> (Lanes<Dance>, OverlayWatch) {
    let [width, height] = headset.info().eye_size;
    let gaussians = u32::try_from(avatar.gaussians.len()).expect("few");
    let options = RendererOptions {
        depth: headset.extensions().has("XR_KHR_composition_layer_depth"),
        ..RendererOptions::new(gaussians + BESIDE, width, height, 2)
    };
    let mut renderer = SplatRenderer::new(Arc::clone(headset.gpu()), &options).expect("a renderer");
    let onnx = onnx::runtime().expect("the test that starts this has looked");
    let backends = InferenceBackends {
        runtime: &onnx,
        threads: 1,
        cache: None,
    };
    let cameras = [-0.03, 0.03].map(|x| {
        let eye = Vec3::new(x, 1.6, 1.6);
        Camera::look_at(eye, eye - Vec3::Z, Vec3::Y, 1.5, width, height)
    });
    let request = PlacementRequest {
        plan: Some(Plan::CpuTail),
        provider: None,
    };
    let placed = place(
        &backends,
        avatar,
        &mut renderer,
        &cameras,
        request,
        &Control::default(),
    );
    let Placed {
        plan,
        inference,
        report,
    } = placed.expect("a placement");
    let options = LaneOptions {
        plan,
        latency: LatencyMode::Interpolate,
        hold: QualityMode::Fixed(0),
        display_period: Duration::from_millis(50),
    };
    let dance = Dance::new(avatar);
    let lanes = Lanes::start(avatar, inference, renderer, dance, &options).expect("lanes start");
    (lanes, OverlayWatch::new(report, None))
}

/// The built-in performance, again and again.
#[derive(Debug)]
struct Dance {
    clip: MotionClip,
    start: Instant,
    sent: u32,
}

impl Dance {
    fn new(avatar: &Avatar) -> Self {
        let clip = MotionClip::built_in(
            &avatar.skeleton,
            &avatar.expressions,
            LOOP_SECONDS,
            MOTION_HZ,
        );
        Self {
            clip: clip.expect("a motion"),
            start: Instant::now(),
            sent: 0,
        }
    }
}

impl MotionSource for Dance {
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        let seconds = f64::from(self.sent) / MOTION_HZ;
        let due = self.start + Duration::from_secs_f64(seconds);
        let wait = due.saturating_duration_since(Instant::now());
        std::thread::sleep(wait.min(longest));
        if wait > longest {
            return None;
        }
        self.sent += 1;
        Some(Pose {
            motion: self.clip.sample(seconds, Playback::Loop),
            source: ConcealmentState::Live,
            captured: Some(due),
            arrived: due,
            due,
            released: Instant::now(),
        })
    }

    fn is_over(&self) -> bool {
        false
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

    fn wants(&mut self, shown: u64, _somebody: bool) -> bool {
        self.look();
        // One for all, once somebody is there: reading takes time.
        shown == 60
    }

    fn seen(&mut self, seen: Seen<'_>) {
        for (eye, picture) in ["left", "right"].iter().zip(seen.pictures) {
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
