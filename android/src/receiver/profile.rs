//! A measurement without a call: the demo avatar performs, this device shows them, and writes where its milliseconds went, as
//! `mon3tr profile` does on a desktop. `android/profile.sh` puts the avatar there, waits for the end and fetches the files.

use super::TaskContext;
use super::call::{config, present};
use crate::settings::Settings;
use android_power::System;
use anyhow::{Context, ensure};
use app_pipeline::placement::InferenceBackends;
use app_pipeline::pool::in_own_pool;
use app_session::headset::{FrameCapture, FrameObserver, HeadsetDisplay};
use app_session::participant::{Origin, Participant};
use app_session::session::Session;
use profile_report::machine::{EVERY, Heat, Sampler, Sysfs, Watch};
use profile_report::{AvatarFigures, Conditions, Folder, Measured, Memory, Report, SessionTerms};
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
        // android/profile.sh waits for it, and is not to wait in vain.
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
        compiled: &compiled,
    };
    let headset = task.find()?.context("the app was closed")?;
    let gpu = Arc::clone(headset.headset().gpu());
    let samplers: Vec<Box<dyn Sampler>> = vec![
        Box::new(Sysfs::new(Path::new("/sys"))),
        Box::new(Heat::new(System::here())),
    ];
    let machine =
        Watch::start(samplers, EVERY).context("cannot watch the device's heat and clocks")?;
    let mut clock = Clock {
        seconds,
        begin: None,
        device_bytes: 0,
        gpu: Arc::clone(&gpu),
    };
    let participant = Participant {
        avatar: Arc::clone(&avatar),
        sits: false,
        origin: Origin::Clip {
            frames: performance.frames,
            rate_hz: MOTION_HZ,
        },
    };
    let config = config(settings, backends);
    let mut display = HeadsetDisplay::new(headset, present(settings), &mut clock);
    let session = Session::new(config, vec![participant], task.control.clone());
    let session = session.run(&mut display)?;
    let headset = display.into_figures();
    let person = session.people.first().context("there was no person")?;
    let begin = clock.begin.context("the headset showed no picture")?;
    let time = [begin, (begin + seconds).min(session.ended)];
    let memory = Memory::now(clock.device_bytes, None);
    let terms = SessionTerms {
        time,
        display_period: headset.display_period(),
        motion_hz: MOTION_HZ,
        encode: None,
    };
    let [width, height] = headset.eye_size;
    let report = Report {
        avatar: AvatarFigures::of(&avatar, &path)
            .with_context(|| format!("cannot read {}", path.display()))?,
        conditions: Conditions {
            motion: "built-in".to_owned(),
            vulkan_device: gpu.info().name.clone(),
            vulkan_driver: gpu.info().driver.clone(),
            onnx_runtime: runtime.version().to_owned(),
            provider: person
                .placement
                .provider
                .map(|provider| provider.to_string()),
            width,
            height,
            views: 2,
            latency: format!("{:?}", settings.latency.value).to_lowercase(),
            cores: cores(),
        },
        memory,
        machine: machine.finish(time[0], time[1]),
        call: None,
        sent: Value::Null,
        shown: Measured::of(&session, person, &terms),
    };
    let (recording, terms) = terms.recording(person);
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

    fn wants_pictures(&mut self, _shown: u64, has_people: bool) -> bool {
        if has_people && self.begin.is_none() {
            self.begin = Some(Instant::now() + WARM_UP);
            self.device_bytes = self.gpu.memory_taken();
        }
        false
    }

    fn captured(&mut self, _frame: FrameCapture<'_>) {}
}

/// Threads this device runs at once.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
