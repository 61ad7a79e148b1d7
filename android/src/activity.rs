//! The activity's own thread: hands Android's events to the driver.

use crate::java;
use crate::launch::Launch;
use crate::lifecycle::{Driver, Event};
use crate::logcat;
use crate::receiver::{Device, HeadsetReceiver, WearersLeave};
use crate::storage::Folders;
use crate::succession::{Aim, Place};
use android_activity::{AndroidApp, InputStatus, MainEvent, PollEvent};
use renderer_openxr::runtime::Runtime;
use std::ffi::c_int;
use std::sync::{Arc, Once};
use std::time::{Duration, Instant};

/// How often to check whether the call has ended by itself.
const LOOK: Duration = Duration::from_millis(250);

/// Where the Hexagon's loader looks for its libraries.
const HEXAGON_FOLDER: &str = "ADSP_LIBRARY_PATH";

/// Called by android-activity on a thread of its own for every activity that is made. An activity that is destroyed and made again
/// may find the same process, and with it everything static.
///
/// It must not return before the activity is destroyed: Android's main thread waits for each of the later events to be taken.
#[unsafe(no_mangle)]
fn android_main(app: AndroidApp) {
    // Held from the first line to the end.
    let _another_may_come = Unregistered::new(&app);
    outlive_closed_connections();
    logcat::start();
    log::info!("Mon3tr {}", env!("CARGO_PKG_VERSION"));
    let intent = java::intent(&app);
    let launch = launch(&app, intent);
    let place = Place::enter(
        launch.as_ref().map_or(Aim::Nowhere, Launch::aim),
        launch
            .as_ref()
            .is_some_and(|launch| launch.settings.is_ok()),
    );
    let mut driver = launch.map(|launch| driver(&app, launch));
    if driver.is_none() {
        java::finish(&app);
    }
    let (mut destroyed, mut closing) = (false, driver.is_none());
    while !destroyed {
        app.poll_events(Some(LOOK), |event| match event {
            // Unread input counts as an app that hangs.
            PollEvent::Main(MainEvent::InputAvailable) => discard_input(&app),
            PollEvent::Main(event) => {
                destroyed |= matches!(event, MainEvent::Destroy);
                if let (Some(driver), Some(event)) = (&mut driver, event_of(&event)) {
                    driver.on(event);
                }
            }
            _ => {}
        });
        // A destroyed activity needs no finish().
        if !destroyed && !closing && driver.as_ref().is_some_and(Driver::has_ended) {
            log::info!("the call is over: closing the app");
            java::finish(&app);
            closing = true;
        }
        if !destroyed
            && !closing
            && let Some(reason) = place.is_over(Instant::now())
        {
            log::info!("{}", reason.text());
            java::finish(&app);
            closing = true;
        }
    }
}

/// Ignores SIGPIPE, which ends a process that writes to a connection that the other side has closed. Rust's runtime
/// does so in programs, and not in a library.
fn outlive_closed_connections() {
    // SAFETY: SIG_IGN is no function, and no handler of this library is replaced.
    unsafe { libc::signal(libc::SIGPIPE, libc::SIG_IGN) };
}

/// Keeps `ndk-context`'s one global context free while an activity lives. android-activity registers each activity there before
/// `android_main` and releases it after, and `ndk-context` aborts the process by an assertion when two are registered. But Android may
/// create an activity before it destroys the last one, when the app is closed and started again at once. Nothing in this process reads
/// that context.
struct Unregistered<'a>(&'a AndroidApp);

impl<'a> Unregistered<'a> {
    fn new(app: &'a AndroidApp) -> Self {
        // SAFETY: android-activity registered this activity on this thread, just before it called `android_main`. What is left is the
        // moment between the two: where Android destroys the activity before this one in it, both are registered, and that aborts.
        unsafe { ndk_context::release_android_context() };
        Self(app)
    }
}

impl Drop for Unregistered<'_> {
    fn drop(&mut self) {
        // SAFETY: the pointers are this activity's. It is registered for android-activity to release: meanwhile Android's main thread
        // waits in this activity's onDestroy, and creates no other.
        unsafe {
            ndk_context::initialize_android_context(self.0.vm_as_ptr(), self.0.activity_as_ptr());
        }
    }
}

/// What the app is to do; nothing on a device that has no place for files.
fn launch(app: &AndroidApp, intent: java::Intent) -> Option<Launch> {
    let Some(own) = app.internal_data_path() else {
        log::error!("Android names no folder for the app's files: nothing can be done");
        return None;
    };
    let shared = app.external_data_path().unwrap_or_else(|| {
        log::warn!(
            "Android names no folder that adb can reach: mon3tr.toml is looked for in the app's own"
        );
        own.clone()
    });
    Some(Launch::new(
        (intent.extras.iter()).map(|(name, text)| (name.as_str(), text.as_str())),
        intent.link.as_deref(),
        intent.trouble,
        Folders::new(own, shared),
    ))
}

/// What drives the call.
fn driver(app: &AndroidApp, launch: Launch) -> Driver<HeadsetReceiver> {
    log::set_max_level(launch.log_level);
    Driver::new(HeadsetReceiver::new(device(app)), launch)
}

/// The package's libraries, and the activity that OpenXR's loader needs.
fn device(app: &AndroidApp) -> Device {
    static FIRST: Once = Once::new();
    let libraries = java::library_folder(app);
    if let Some(folder) = &libraries {
        // Once a process: a receiver's threads may be there when the next activity is created, and the folder is the same.
        // SAFETY: no receiver's thread was started yet, and the activity's own Java threads read no such variable.
        FIRST.call_once(|| unsafe { std::env::set_var(HEXAGON_FOLDER, folder) });
    }
    let app = app.clone();
    let leave = Arc::new(OfActivity(app.clone()));
    Device {
        // SAFETY: the pointers are good as long as the activity, which the receiver is left before.
        open_xr: Box::new(move || unsafe {
            Runtime::load_android(app.vm_as_ptr().cast(), app.activity_as_ptr().cast())
        }),
        onnx_runtime: libraries.map(|folder| folder.join("libonnxruntime.so")),
        leave,
        give_memory_back,
    }
}

/// Has bionic's allocator give back to the system what was freed and is kept for later.
fn give_memory_back() {
    /// `M_PURGE` of bionic's malloc.h, from Android 9 on.
    const PURGE: c_int = -101;
    unsafe extern "C" {
        fn mallopt(option: c_int, value: c_int) -> c_int;
    }
    // SAFETY: two numbers; an allocator that does not know the option does nothing.
    let done = unsafe { mallopt(PURGE, 0) };
    if done == 0 {
        log::debug!("the allocator gives nothing back");
    }
}

/// The permissions of an activity, which lives longer than its receiver.
struct OfActivity(AndroidApp);

impl WearersLeave for OfActivity {
    fn may_record(&self) -> bool {
        java::may_record(&self.0)
    }

    fn ask(&self) {
        java::ask_to_record_and_watch(&self.0);
    }
}

/// Hands and controllers come through OpenXR; keys and touches of Android's are the system's.
fn discard_input(app: &AndroidApp) {
    match app.input_events_iter() {
        Ok(mut events) => while events.next(|_| InputStatus::Unhandled) {},
        Err(error) => log::warn!("Android's input cannot be read: {error}"),
    }
}

/// No command for events of windows' contents, which the app does not have.
fn event_of(event: &MainEvent<'_>) -> Option<Event> {
    match event {
        MainEvent::Start => Some(Event::Start),
        MainEvent::Resume { .. } => Some(Event::Resume),
        MainEvent::Pause => Some(Event::Pause),
        MainEvent::Stop => Some(Event::Stop),
        MainEvent::GainedFocus => Some(Event::FocusGained),
        MainEvent::LostFocus => Some(Event::FocusLost),
        MainEvent::InitWindow { .. } => Some(Event::WindowMade),
        MainEvent::TerminateWindow { .. } => Some(Event::WindowDestroyed),
        MainEvent::LowMemory => Some(Event::LowMemory),
        MainEvent::ConfigChanged { .. } => Some(Event::ConfigChanged),
        MainEvent::SaveState { .. } => Some(Event::SaveState),
        MainEvent::Destroy => Some(Event::Destroy),
        _ => None,
    }
}
