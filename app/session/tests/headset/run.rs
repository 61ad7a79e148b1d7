//! Starting the program under test beside a runtime, and what it told.

use crate::program::{ALIVE, Holdings, NAME, ORDERS, Orders, REPORT, Shown};
use serde::Deserialize;
use serde_json::Value;
use std::fs::File;
use std::process::{Child, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use test_support::load::Load;
use test_support::monado::Monado;
use test_support::service::{LONGEST_WAIT, assert_all_live};
use test_support::{onnx, vulkan};

/// What a run came to.
#[derive(Debug, Deserialize)]
pub(crate) struct Report {
    /// The headset's figures.
    pub(crate) figures: Value,
    pub(crate) holdings: Vec<Holdings>,
    pub(crate) shown: Vec<Shown>,
    /// The part of all processors' time that other programs had.
    #[serde(skip)]
    pub(crate) others: f64,
    validated: bool,
    validation_messages: u32,
}

/// The program, running. It is killed where a test forgets it.
pub(crate) struct Run {
    child: Child,
    folder: TempDir,
    /// What it had said and written when it last gave a sign of life, and when that was.
    heard: (u64, Instant),
    load: Option<Load>,
}

/// Nothing, after a line that says why, where a component is missing. Otherwise leave to run, which one test has at a time: they would
/// slow each other down.
pub(crate) fn turn() -> Option<MutexGuard<'static, ()>> {
    static ALONE: Mutex<()> = Mutex::new(());
    onnx::runtime()?;
    vulkan::gpu()?;
    Some(ALONE.lock().unwrap_or_else(PoisonError::into_inner))
}

impl Run {
    /// Starts the program so that it finds this runtime.
    pub(crate) fn start(monado: &Monado, seconds: f64) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let orders = Orders {
            seconds,
            folder: folder.path().to_owned(),
        };
        let log = File::create(folder.path().join("log")).expect("a file");
        // Where this was started through a wrapper, its own file is another's.
        let this = std::env::args_os().next().expect("a program's name");
        let child = monado
            .client(this)
            .args([NAME, "--exact", "--ignored", "--nocapture"])
            .env(ORDERS, serde_json::to_string(&orders).expect("text"))
            .stdin(Stdio::null())
            .stdout(log.try_clone().expect("the same file"))
            .stderr(log)
            .spawn()
            .expect("this program can be started again");
        let processes = monado.processes().into_iter().chain([child.id()]);
        Self {
            load: Some(Load::watch(processes)),
            child,
            folder,
            heard: (0, Instant::now()),
        }
    }

    /// Whether it has not ended.
    pub(crate) fn is_running(&mut self) -> bool {
        assert_all_live();
        let ended = self.child.try_wait().expect("a child can be asked");
        let size = |name: &str| {
            std::fs::metadata(self.folder.path().join(name)).map_or(0, |file| file.len())
        };
        let said = size("log") + size(ALIVE);
        if said > self.heard.0 {
            self.heard = (said, Instant::now());
        }
        assert!(
            self.heard.1.elapsed() < LONGEST_WAIT,
            "it is late:\n{}",
            self.said()
        );
        ended.is_none()
    }

    /// Waits for its good end.
    pub(crate) fn report(mut self) -> Report {
        while self.is_running() {
            std::thread::sleep(Duration::from_millis(50));
        }
        let status = self.child.wait().expect("it has ended");
        let others = self.load.take().map_or(0.0, Load::others);
        let said = self.said();
        assert!(status.success(), "{status}:\n{said}");
        let report = std::fs::read_to_string(self.folder.path().join(REPORT));
        let report = report.unwrap_or_else(|why| panic!("no report: {why}\n{said}"));
        let mut report: Report = serde_json::from_str(&report).expect("a report");
        report.others = others;
        assert_eq!(report.validation_messages, 0, "validation:\n{said}");
        if !report.validated {
            let must = std::env::var("CI").as_deref() == Ok("true");
            assert!(!must, "CI must have Vulkan's validation layer");
            println!("skipped: validation: no layer on this machine");
        }
        for eye in ["left", "right"] {
            self.assert_shows_a_person(eye);
        }
        report
    }

    /// That somebody stands before the bright studio in the picture which this eye had.
    fn assert_shows_a_person(&self, eye: &str) {
        let file = self.folder.path().join(format!("{eye}.png"));
        let picture = image::open(&file);
        let picture = picture.unwrap_or_else(|why| panic!("{}: {why}", file.display()));
        let picture = picture.into_rgb8();
        let dark = picture.pixels().filter(|one| one.0[0] < 100).count();
        assert!(dark > 500, "{eye} shows nobody: {dark} dark pixels");
    }

    fn said(&self) -> String {
        std::fs::read_to_string(self.folder.path().join("log")).unwrap_or_default()
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        // It has ended as a rule.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
