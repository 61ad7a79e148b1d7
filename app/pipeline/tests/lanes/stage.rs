//! A puppet that swings its arms, lanes that show it, and a camera in front of it.

use app_pipeline::compiled_sources::CompiledSources;
use app_pipeline::concealment::ConcealmentState;
use app_pipeline::inference::Inference;
use app_pipeline::lanes::{DisplayClock, Drawn, Joined, LaneOptions, Lanes, MotionSource, Pose};
use app_pipeline::plan::Plan;
use app_pipeline::posing::{bound_mesh, bound_mesh_with_networks};
use app_pipeline::profile::FrameTimes;
use app_pipeline::quality::QualityMode;
use app_pipeline::timeline::LatencyMode;
use glam::{Quat, Vec3};
use npu_runtime::{Provider, Runtime};
use renderer_splat::camera::Camera;
use renderer_splat::options::{BackEnd, RendererOptions};
use renderer_splat::picture::Backdrop;
use renderer_splat::renderer::SplatRenderer;
use renderer_vulkan::choice::GpuChoice;
use renderer_vulkan::gpu::Gpu;
use spmm3::{Avatar, Joint, MotionParams};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use synthetic_person::Puppet;
use test_support::{onnx, vulkan};

/// Pixels of a picture's side.
pub(crate) const SIDE: u32 = 96;

pub(crate) const BLACK: Backdrop = Backdrop::Colour([0.0; 3]);

/// The display's rate.
const HERTZ: f64 = 90.0;

/// One provider.
pub(crate) const CPU: Provider = Provider::Cpu { threads: 1 };

/// Poses at a rate, as many as there are.
#[derive(Debug)]
pub(crate) struct Swing {
    pub(crate) hertz: f64,
    pub(crate) left: u64,
    /// Radians a second.
    pub(crate) speed: f32,
    /// Says that there are no more.
    pub(crate) hangs_up: Arc<AtomicBool>,
    start: Instant,
    sent: u32,
}

impl Swing {
    pub(crate) fn new(hertz: f64, left: u64, speed: f32) -> Self {
        Self {
            hertz,
            left,
            speed,
            hangs_up: Arc::default(),
            start: Instant::now(),
            sent: 0,
        }
    }

    /// Someone who says nothing for a long time.
    pub(crate) fn silent() -> Self {
        Self {
            start: Instant::now() + Duration::from_secs(3600),
            ..Self::new(30.0, 1000, 0.5)
        }
    }

    /// The pose so many seconds after the start.
    pub(crate) fn at(speed: f32, seconds: f32) -> MotionParams {
        let mut motion = MotionParams::default();
        let swing = 0.6 * (seconds * speed / 0.6).sin();
        motion.set_rotation(Joint::LeftShoulder, Quat::from_rotation_z(swing));
        motion.set_rotation(Joint::RightShoulder, Quat::from_rotation_y(swing));
        motion.root_translation = Vec3::X * 0.1 * swing;
        motion
    }
}

impl MotionSource for Swing {
    fn next(&mut self, longest: Duration) -> Option<Pose> {
        let due = self.start + Duration::from_secs_f64(f64::from(self.sent) / self.hertz);
        let wait = due.saturating_duration_since(Instant::now());
        std::thread::sleep(wait.min(longest));
        if self.is_over() || wait > longest {
            return None;
        }
        self.left -= 1;
        self.sent += 1;
        let seconds = (due - self.start).as_secs_f32();
        Some(Pose {
            motion: Self::at(self.speed, seconds),
            times: FrameTimes {
                captured: Some(due),
                released: Instant::now(),
                ..FrameTimes::new(ConcealmentState::Live, due)
            },
        })
    }

    fn is_over(&self) -> bool {
        self.left == 0 || self.hangs_up.load(Relaxed)
    }
}

/// Lanes before a camera.
pub(crate) struct Stage {
    pub(crate) lanes: Lanes<Swing>,
    pub(crate) display: DisplayClock,
    pub(crate) camera: Camera,
    /// What a picture takes besides.
    pub(crate) slowed: Duration,
    avatar: Arc<Avatar>,
    runtime: Runtime,
    /// One at a time: they would slow each other down.
    _alone: MutexGuard<'static, ()>,
}

/// A device of this test's own, to be lost.
pub(crate) fn own_gpu() -> Option<Arc<Gpu>> {
    vulkan::gpu()?;
    let name = std::env::var("MON3TR_GPU").unwrap_or_default();
    let choice: GpuChoice = name.parse().expect("any text is a choice");
    Some(Gpu::open(&choice, false).expect("a device"))
}

impl Stage {
    /// `None` where a component is missing, which says why.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        plan: Plan,
        providers: &[Provider],
        swing: Swing,
    ) -> Option<Self> {
        let display = (HERTZ, QualityMode::Fixed(0));
        Self::on_display(gpu, plan, providers, swing, display)
    }

    /// The same on a display of that rate, which gives up quality for it or not.
    pub(crate) fn on_display(
        gpu: &Arc<Gpu>,
        plan: Plan,
        providers: &[Provider],
        swing: Swing,
        (hertz, quality): (f64, QualityMode),
    ) -> Option<Self> {
        static ALONE: Mutex<()> = Mutex::new(());
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let runtime = onnx::runtime()?;
        let avatar = Arc::new(avatar());
        let gaussians = u32::try_from(avatar.gaussians.len()).expect("few");
        let options = RendererOptions {
            back_end: Some(BackEnd::Tiles),
            mesh: match plan {
                Plan::Gpu => Some(bound_mesh(&avatar)),
                Plan::GpuAlone => Some(bound_mesh_with_networks(&avatar)),
                Plan::Npu | Plan::CpuTail | Plan::Cpu => None,
            }
            .map(|mesh| Arc::new(mesh.expect("a mesh"))),
            // Room for two people and some scenery.
            ..RendererOptions::new(2 * gaussians + 256, SIDE, SIDE, 1)
        };
        let renderer = SplatRenderer::new(Arc::clone(gpu), &options).expect("a renderer");
        let sources = CompiledSources::default();
        let open = |graph| Inference::open(&runtime, &avatar, graph, providers, &sources);
        let inference = plan.graph().map(|graph| open(graph).expect("a session"));
        let options = LaneOptions {
            plan,
            latency: LatencyMode::Interpolate,
            quality,
            display_period: Duration::from_secs_f64(1.0 / hertz),
            expected_picture: None,
        };
        let lanes =
            Lanes::start(&avatar, inference, renderer, swing, &options).expect("lanes start");
        Some(Self {
            lanes,
            display: DisplayClock::new(hertz),
            camera: camera(SIDE),
            slowed: Duration::ZERO,
            avatar,
            runtime,
            _alone: alone,
        })
    }

    /// Somebody joins, who looks the same.
    pub(crate) fn join(&mut self, plan: Plan, swing: Swing) -> Joined<Swing> {
        let avatar = Arc::clone(&self.avatar);
        self.join_as(&avatar, plan, swing)
    }

    /// Somebody joins who looks like this.
    pub(crate) fn join_as(
        &mut self,
        avatar: &Arc<Avatar>,
        plan: Plan,
        swing: Swing,
    ) -> Joined<Swing> {
        let graph = plan.graph().expect("the host's networks");
        let sources = CompiledSources::default();
        let inference = Inference::open(&self.runtime, avatar, graph, &[CPU], &sources);
        let inference = inference.expect("a session");
        let joined = self.lanes.join(avatar, Some(inference), swing, plan);
        joined.expect("somebody joins")
    }

    /// Draws pictures until so many people are to be seen.
    pub(crate) fn draw_until_seen(&mut self, people: usize) {
        let until = Instant::now() + Duration::from_secs(60);
        loop {
            self.picture();
            let seen = self.lanes.poses().flatten().count();
            if seen == people {
                return;
            }
            assert!(Instant::now() < until, "{seen} of {people} people");
        }
    }

    /// Draws the next picture; returns the pose shown, if there was one.
    pub(crate) fn picture(&mut self) -> Option<MotionParams> {
        self.display.wait();
        let begun = Instant::now();
        let tick = self.display.tick(begun);
        let motion = self.lanes.begin(tick).expect("lanes run").cloned()?;
        match self
            .lanes
            .draw(&[self.camera])
            .expect("the picture is drawn")
        {
            Drawn::Picture => {
                std::thread::sleep(self.slowed);
                let shown = self.display.drawn(begun, Instant::now());
                self.lanes.displayed(shown);
            }
            Drawn::Renewed(_) | Drawn::Lost => return None,
        }
        Some(motion)
    }

    /// Draws so many pictures, however long that takes.
    pub(crate) fn draw(&mut self, pictures: u32) {
        // Each has that long.
        let mut until = Instant::now() + Duration::from_secs(60);
        let mut drawn = 0;
        while drawn < pictures {
            assert!(Instant::now() < until, "{drawn} of {pictures} pictures");
            if self.picture().is_some() {
                drawn += 1;
                until = Instant::now() + Duration::from_secs(60);
            }
        }
    }

    /// Draws pictures for so long; returns how many.
    pub(crate) fn run(&mut self, time: Duration) -> u32 {
        let start = Instant::now();
        let mut pictures = 0;
        while start.elapsed() < time {
            pictures += u32::from(self.picture().is_some());
        }
        pictures
    }
}

pub(crate) fn avatar() -> Avatar {
    let bytes = Puppet::small().avatar().to_bytes().expect("a package");
    Avatar::read(std::io::Cursor::new(bytes)).expect("the package is sound")
}

pub(crate) fn camera(side: u32) -> Camera {
    let (eye, target) = (Vec3::new(0.0, 1.0, 4.0), Vec3::Y * 0.9);
    Camera::look_at(eye, target, Vec3::Y, 0.6, side, side)
}
