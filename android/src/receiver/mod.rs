//! The call in a headset, as the activity's life-cycle drives it. This is the one place where the app meets the receiver.
//!
//! A thread of its own finds the headset and runs the app's task in it: rooms to look into (`call.rs`), a call of several (`member.rs`), a
//! measurement (`profile.rs`), or the panel of missing settings. The activity's thread pauses, resumes and ends it through a [`Control`].

mod call;
mod consent;
mod member;
mod microphone;
mod missing;
mod network;
mod profile;
mod shown;
mod turn;

use crate::first_run;
use crate::launch::Launch;
use crate::lifecycle::{Receiver, Trim};
use crate::settings::{Settings, Task};
use android_power::System;
use android_power::thermal::HeatLog;
use anyhow::Context;
use app_pipeline::control::Control;
use app_session::display::SessionError;
use app_session::headset::HeadsetHandle;
use link_http::Client;
use missing::show_until_closed;
use profile_report::resident_bytes;
use renderer_openxr::error::XrError;
use renderer_openxr::headset::HeadsetOptions;
use renderer_openxr::runtime::Runtime;
use shown::ShownFrames;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;
use turn::HEADSET;

/// How long a pause waits for the GPU's step that was begun. Android's main thread may wait meanwhile, and must not wait long.
const PATIENCE: Duration = Duration::from_millis(80);

/// What the device provides.
pub struct Device {
    /// Loads OpenXR's loader. Called once, from the receiver's own thread.
    pub open_xr: Box<dyn FnOnce() -> Result<Runtime, XrError> + Send>,
    /// ONNX Runtime's library; nothing for the default search.
    pub onnx_runtime: Option<PathBuf>,
    /// Whether the app may hear and watch its wearer.
    pub leave: Arc<dyn WearersLeave>,
    /// Gives back to the system what the allocator keeps for later.
    pub give_memory_back: fn(),
}

/// The wearer's leave to record what they say, and to watch their body, face and eyes, which they give and take in the headset.
pub trait WearersLeave: Send + Sync {
    /// Whether what they say may be recorded. It may be asked from any thread.
    fn may_record(&self) -> bool;

    /// Has the system ask them for what they have not answered yet. Returns before they have answered.
    fn ask(&self);
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Device")
            .field("onnx_runtime", &self.onnx_runtime)
            .finish_non_exhaustive()
    }
}

/// Shows the call in the headset.
#[derive(Debug)]
pub struct HeadsetReceiver {
    give_memory_back: fn(),
    device: Option<Device>,
    control: Control,
    thread: Option<JoinHandle<()>>,
    over: Arc<AtomicBool>,
    frames: ShownFrames,
}

impl HeadsetReceiver {
    /// One without a command yet.
    #[must_use]
    pub fn new(device: Device) -> Self {
        Self {
            give_memory_back: device.give_memory_back,
            device: Some(device),
            control: Control::default(),
            thread: None,
            over: Arc::default(),
            frames: ShownFrames::default(),
        }
    }

    /// Frames with people that were shown so far; other threads may read it.
    #[must_use]
    pub fn frames(&self) -> Arc<AtomicU64> {
        self.frames.with_people()
    }
}

impl Receiver for HeadsetReceiver {
    fn start(&mut self, launch: Launch) {
        let Some(device) = self.device.take() else {
            return;
        };
        let (control, over) = (self.control.clone(), Arc::clone(&self.over));
        let frames = self.frames.clone();
        let work = move || {
            if let Err(error) = run(device, &launch, &control, &frames)
                && !has_left(&error)
            {
                log::error!("{error:#}");
            }
            over.store(true, Relaxed);
        };
        match std::thread::Builder::new()
            .name("receiver".to_owned())
            .spawn(work)
        {
            Ok(thread) => self.thread = Some(thread),
            Err(error) => {
                log::error!("cannot start the receiver's thread: {error}");
                self.over.store(true, Relaxed);
            }
        }
    }

    fn pause(&mut self) {
        if !self.control.pause(PATIENCE) {
            // A driver may take long to compile what the first picture needs. No other step follows.
            log::warn!("the app pauses while the GPU ends what it had begun");
        }
    }

    fn resume(&mut self) {
        self.frames.resume();
        self.control.resume();
    }

    fn trim_memory(&mut self, _what: Trim) {
        // What pictures need was made ready before the first frame, and is in use. What loading, trying placements and networks that were not chosen took
        // was freed, and the allocator keeps it.
        let before = resident_bytes().unwrap_or(0);
        (self.give_memory_back)();
        let now = resident_bytes().unwrap_or(0);
        log::warn!(
            "the system is short of memory: {:.0} MB of {:.0} MB are given back",
            before.saturating_sub(now) as f64 / 1e6,
            before as f64 / 1e6
        );
    }

    fn leave(&mut self) {
        self.control.leave();
        if self
            .thread
            .take()
            .is_some_and(|thread| thread.join().is_err())
        {
            log::error!("the receiver's thread failed");
        }
        self.over.store(true, Relaxed);
    }

    fn is_over(&self) -> bool {
        self.over.load(Relaxed)
    }
}

/// What a task needs: the headset's runtime, the device's libraries, and the control that ends it.
struct TaskContext<'a> {
    open_xr: Runtime,
    onnx_runtime: Option<PathBuf>,
    leave: Arc<dyn WearersLeave>,
    launch: &'a Launch,
    control: &'a Control,
    frames: &'a ShownFrames,
}

/// Whether the error means only that the activity ended before anything was shown.
fn has_left(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(SessionError::Left))
}

/// Runs the app's task. Errors are shown in the headset, as long as there is one.
fn run(
    device: Device,
    launch: &Launch,
    control: &Control,
    frames: &ShownFrames,
) -> anyhow::Result<()> {
    let Some(_turn) = HEADSET.wait(control) else {
        return Ok(());
    };
    // Ends with the task.
    let _heat = HeatLog::start(System::here());
    let task = TaskContext {
        open_xr: (device.open_xr)()?,
        onnx_runtime: device.onnx_runtime,
        leave: device.leave,
        launch,
        control,
        frames,
    };
    let settings = match &launch.settings {
        Ok(settings) => settings,
        Err(problems) => {
            for problem in problems {
                log::warn!("{problem}");
            }
            return show_until_closed(&task, "Welcome to Mon3tr", first_run::lines(problems));
        }
    };
    match task.perform(settings) {
        Ok(()) => Ok(()),
        // Nothing can be shown there.
        Err(error) if error.is::<XrError>() || error.is::<SessionError>() => Err(error),
        Err(error) => {
            log::error!("{error:#}");
            show_until_closed(
                &task,
                "This does not work",
                first_run::wrapped(&format!("{error:#}")),
            )
        }
    }
}

impl TaskContext<'_> {
    fn perform(&self, settings: &Settings) -> anyhow::Result<()> {
        if !consent::is_given(self, settings)? {
            return Ok(());
        }
        match &settings.task {
            Task::Call(rooms) => call::run(self, settings, &rooms.value),
            Task::Member(link) => member::run(self, settings, &link.value),
            Task::Profile(time) => profile::run(self, settings, time.value),
        }
    }

    /// The headset; nothing if it is time to leave before it may be opened.
    fn find(&self) -> Result<Option<HeadsetHandle>, XrError> {
        let options = HeadsetOptions {
            eye_size: None,
            validation: false,
        };
        let Some(_step) = self.control.step() else {
            return Ok(None);
        };
        HeadsetHandle::open(self.open_xr.clone(), options).map(Some)
    }

    /// For servers, with the certificates that the settings trust besides the public ones.
    fn client(&self, settings: &Settings) -> anyhow::Result<Client> {
        let file = settings.ca.value.as_ref();
        let file = file.map(|file| self.launch.folders.certificates(file.as_str()));
        Client::new(file.as_deref()).context("the certificates that the setting `ca` names")
    }

    /// ONNX Runtime.
    fn onnx_runtime(&self) -> anyhow::Result<npu_runtime::Runtime> {
        Ok(npu_runtime::Runtime::open(self.onnx_runtime.as_deref())?)
    }
}
