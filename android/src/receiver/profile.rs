//! A measurement without a call: the demo person performs, this device shows them, and writes how long each task took, as
//! `mon3tr profile` does on a desktop. `android/profile.sh` puts the avatar there, waits for the end and fetches the files.

use super::TaskContext;
use super::call::wishes;
use crate::settings::Settings;
use anyhow::{Context, ensure};
use app_pipeline::placement::InferenceBackends;
use app_pipeline::pool::in_own_pool;
use app_pipeline::profile::{Recording, Summary, Terms};
use app_pipeline::timeline::LatencyMode;
use app_session::headset::{FrameObserver, Gathered, Party, Seen, show_party};
use app_session::visit::Rehearsal;
use npu_runtime::Runtime;
use profile_report::machine::{EVERY, Sysfs, Watch};
use profile_report::{AvatarFigures, Conditions, Folder, Measured, Memory, Report};
use renderer_vulkan::gpu::Gpu;
use serde_json::Value;
use spmm3::{Avatar, LOOP_SECONDS, MotionClip};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Motions a second, the paper's.
const MOTION_HZ: f64 = 30.0;
/// From the first picture until measuring begins: buffers find their size, clocks settle.
const WARM_UP: Duration = Duration::from_secs(2);

/// Measures for `seconds`, and writes the result into the folder.
pub(super) fn run(
    task: &TaskContext<'_>,
    settings: &Settings,
    seconds: Duration,
) -> anyhow::Result<()> {
    let folder = Folder::begin(&task.launch.folders.profile())?;
    let outcome = measure(task, settings, seconds, &folder);
    if let Err(error) = &outcome {
        // So that the script does not wait for a profile that failed.
        folder.failed(&format!("{error:#}"))?;
    }
    outcome
}

fn measure(
    task: &TaskContext<'_>,
    settings: &Settings,
    seconds: Duration,
    folder: &Folder,
) -> anyhow::Result<()> {
    let path = task.launch.folders.demo_avatar();
    ensure!(
        path.is_file(),
        "there is no avatar {}: android/profile.sh puts one there",
        path.display()
    );
    let avatar = in_own_pool("package", || Avatar::load(&path))?
        .with_context(|| format!("cannot use the avatar package {}", path.display()))?;
    let avatar = Arc::new(avatar);
    let performance = MotionClip::built_in(
        &avatar.skeleton,
        &avatar.expressions,
        LOOP_SECONDS,
        MOTION_HZ,
    )?;
    let runtime = task.onnx_runtime()?;
    let compiled = task.launch.folders.compiled();
    let backends = InferenceBackends {
        runtime: &runtime,
        threads: cores(),
        cache: Some(&compiled),
    };
    let found = task.find()?.context("the app was closed")?;
    let gpu = Arc::clone(found.headset().gpu());
    let machine = Watch::start(vec![Box::new(Sysfs::new(Path::new("/sys")))], EVERY)
        .context("cannot watch the device's heat and clocks")?;
    let join = || Gathered {
        sources: vec![Rehearsal::new(performance.frames, MOTION_HZ)],
        watch: None,
    };
    let mut clock = Clock {
        seconds,
        begin: None,
        device_bytes: 0,
        gpu: Arc::clone(&gpu),
    };
    let wishes = wishes(settings);
    let avatars = [Arc::clone(&avatar)];
    let party = show_party(
        found,
        &backends,
        &wishes,
        &avatars,
        join,
        task.control,
        &mut clock,
    )?;
    let begin = clock.begin.context("the headset showed no picture")?;
    let end = (begin + seconds).min(Instant::now());
    let memory = Memory::now(clock.device_bytes, None);
    let recording = Recording::new(&party.collector, begin, end);
    let terms = Terms {
        display_period: party.display_period(),
        motion_hz: MOTION_HZ,
        units: party.placement.units(),
        encode: None,
        lost_events: party.collector.lost(),
    };
    let latency = settings.latency.value;
    let report = Report {
        avatar: AvatarFigures::of(&avatar, &path)
            .with_context(|| format!("cannot read {}", path.display()))?,
        conditions: conditions(&party, &gpu, &runtime, latency),
        memory,
        machine: machine.finish(begin, end),
        call: None,
        sent: Value::Null,
        shown: Measured {
            measured: Summary::new(&recording, &terms),
            placement: party.placement,
            skipped: party.skipped,
            hold: party.hold,
        },
    };
    folder.write(&report, &recording, &terms)?;
    log::info!("the profile is written");
    Ok(())
}

/// Decides when it is over, and reads the memory use before.
struct Clock {
    seconds: Duration,
    begin: Option<Instant>,
    device_bytes: u64,
    gpu: Arc<Gpu>,
}

impl FrameObserver for Clock {
    fn is_over(&self, _shown: u64) -> bool {
        self.begin
            .is_some_and(|begin| Instant::now() >= begin + self.seconds)
    }

    fn wants(&mut self, _shown: u64, person_is_shown: bool) -> bool {
        if person_is_shown && self.begin.is_none() {
            self.begin = Some(Instant::now() + WARM_UP);
            self.device_bytes = self.gpu.memory_taken();
        }
        false
    }

    fn seen(&mut self, _seen: Seen<'_>) {}
}

fn conditions<S>(
    party: &Party<S>,
    gpu: &Gpu,
    runtime: &Runtime,
    latency: LatencyMode,
) -> Conditions {
    let [width, height] = party.headset.eye_size;
    Conditions {
        motion: "built-in".to_owned(),
        vulkan_device: gpu.info().name.clone(),
        vulkan_driver: gpu.info().driver.clone(),
        onnx_runtime: runtime.version().to_owned(),
        provider: party.placement.provider.to_string(),
        width,
        height,
        views: 2,
        latency: format!("{latency:?}").to_lowercase(),
        cores: cores(),
    }
}

/// Threads this device runs at once.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
