//! The host process: loads the app's library as Android would, and executes the driver's requests, one line at a time.
//!
//!     host LIBMAIN FOLDER LIBRARIES
//!
//! FOLDER gets the app's files; LIBRARIES is what `ApplicationInfo.nativeLibraryDir` names. Requests come on the standard input, answers
//! go to what the standard output was at the start: android-activity takes standard output and error for the log.

mod activity;
mod census;
mod java;
mod shims;

use activity::{Activity, Folders, OnCreateFunction};
use android_rehearsal::protocol::{Answer, Callback, Census, Reply, Request};
use anyhow::{Context, bail};
use java::Machine;
use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
use shims::Shims;
use std::ffi::c_void;
use std::fs::File;
use std::io::{BufRead, Write};
use std::path::Path;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// How long input events may lie in their queue before the driver gets their state.
const INPUT: Duration = Duration::from_millis(600);

/// The Java machine, for the hook that the shim of `libandroid.so` calls.
static MACHINE: OnceLock<Machine> = OnceLock::new();

fn main() -> anyhow::Result<()> {
    let [library, folder, libraries]: [String; 3] = std::env::args()
        .skip(1)
        .collect::<Vec<_>>()
        .try_into()
        .map_err(|_| anyhow::anyhow!("host LIBMAIN FOLDER LIBRARIES"))?;
    let mut answers = File::from(rustix::io::fcntl_dupfd_cloexec(std::io::stdout(), 100)?);
    let folders = Folders::below(Path::new(&folder))?;
    let machine = MACHINE.get_or_init(|| Machine::start(&libraries));
    let shims = Shims::load(on_native_finish)?;
    // As System.loadLibrary on Android: the library's own neighbours come first, whatever this process has loaded.
    let flags = RTLD_NOW | RTLD_LOCAL | libc::RTLD_DEEPBIND;
    // SAFETY: the app's library; its initialisers are what is to be rehearsed.
    let app = unsafe { Library::open(Some(&library), flags) }.context("the app's library")?;
    let on_create = OnCreateFunction::of(&app)?;
    std::env::set_current_dir("/")?;
    let mut host = Host {
        machine,
        shims,
        on_create,
        folders,
        activities: Vec::new(),
    };
    for line in std::io::stdin().lock().lines() {
        let request: Request = serde_json::from_str(&line?)?;
        if matches!(request, Request::Quit) {
            // Android's processes run no destructors of libraries at their end.
            // SAFETY: it takes nothing and does not return.
            unsafe { libc::_exit(0) };
        }
        let begun = Instant::now();
        let answer = host.answer(request)?;
        let blocked_ms = begun.elapsed().as_secs_f64() * 1e3;
        let reply = serde_json::to_string(&Reply { blocked_ms, answer })?;
        writeln!(answers, "{reply}")?;
    }
    Ok(())
}

unsafe extern "C" fn on_native_finish(activity: *mut c_void) {
    if let Some(machine) = MACHINE.get() {
        // SAFETY: android-activity passes what it was created with, which lives until it is destroyed.
        machine.finished_natively(unsafe { activity::object_of(activity) });
    }
}

struct Host {
    machine: &'static Machine,
    shims: Shims,
    on_create: OnCreateFunction,
    folders: Folders,
    /// In the order of their creation; nothing for one that was destroyed.
    activities: Vec<Option<Activity>>,
}

impl Host {
    fn answer(&mut self, request: Request) -> anyhow::Result<Answer> {
        Ok(match request {
            Request::Create(intent) => {
                let index = self.activities.len();
                let (folders, machine) = (&self.folders, self.machine);
                let activity = Activity::create(self.on_create, index, intent, folders, machine);
                self.activities.push(Some(activity));
                Answer::Created(index)
            }
            Request::Callback(index, callback) => {
                let place = self.activities.get_mut(index);
                let place = place.context("there is no such activity")?;
                let activity = place.as_mut().context("that activity is destroyed")?;
                activity.call(callback, &self.shims)?;
                if callback == Callback::Destroy {
                    self.machine.forget_activity(activity.object());
                    *place = None;
                }
                Answer::Done
            }
            Request::Input(index, events) => {
                let activity = self.activities.get(index).and_then(Option::as_ref);
                let activity = activity.context("there is no such activity")?;
                activity.put_input(&self.shims, events)?;
                std::thread::sleep(INPUT);
                Answer::Input(activity.input_figures(&self.shims))
            }
            Request::Census => {
                let census = Census {
                    frames: self.shims.frames(),
                    window_references: self.shims.window_references(),
                    power: self.shims.power(),
                    java: self.machine.census(),
                    ..census::take()?
                };
                Answer::Census(Box::new(census))
            }
            Request::Quit => bail!("answered before"),
        })
    }
}
