//! Third-party programs that a test runs: Monado, an X server, NATS. One that dies is noticed at once and named, with how it
//! ended and its last output, and is started again, twice at most. Each restart is a line `started again: ..`, which `./run test`
//! counts.
//!
//! Where one dies in the middle of a test, all of the test is run again: [`attended`].

#[cfg(test)]
mod tests;

use std::cell::RefCell;
use std::fmt::{self, Display, Formatter};
use std::fs::File;
use std::net::TcpStream;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

/// The longest wait of a test for a program.
pub const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// How often a program is started again.
pub const RESTARTS: usize = 2;

/// How often a program is checked.
const LOOK: Duration = Duration::from_millis(20);

/// Lines of a log in a message.
const LAST_LINES: usize = 20;

/// How a program ended that should not have ended.
#[derive(Debug, Clone)]
pub struct Death {
    name: &'static str,
    status: ExitStatus,
    said: String,
}

impl Death {
    /// Prints, for the summary too, that the program is started again.
    pub fn print_restart(&self) {
        let Self { name, status, .. } = self;
        crate::tell(&format!("started again: {name} ended by itself: {status}"));
    }
}

impl Display for Death {
    fn fmt(&self, to: &mut Formatter<'_>) -> fmt::Result {
        let Self { name, status, said } = self;
        write!(
            to,
            "{name} ended by itself ({status}); it said last:\n{said}"
        )
    }
}

#[derive(Debug)]
struct Inner {
    name: &'static str,
    child: Child,
    log: PathBuf,
    /// Whether ending with success is allowed.
    may_end: bool,
    /// Whether the test ended it.
    killed: bool,
}

/// A program that runs. It ends with this.
#[derive(Debug)]
pub struct Service(Arc<Mutex<Inner>>);

thread_local! {
    /// Those that this test has started.
    static STARTED: RefCell<Vec<Weak<Mutex<Inner>>>> = const { RefCell::new(Vec::new()) };
    /// The first that died while its test failed.
    static DIED: RefCell<Option<Death>> = const { RefCell::new(None) };
}

fn lock(inner: &Mutex<Inner>) -> MutexGuard<'_, Inner> {
    inner.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Inner {
    fn death(&mut self) -> Option<Death> {
        if self.killed {
            return None;
        }
        let status = self.child.try_wait().expect("a child can be asked")?;
        (!(self.may_end && status.success())).then(|| Death {
            name: self.name,
            status,
            said: last_lines(&self.log),
        })
    }
}

fn last_lines(log: &Path) -> String {
    let log = std::fs::read(log).unwrap_or_default();
    let log = String::from_utf8_lossy(&log);
    let lines: Vec<_> = log.lines().collect();
    lines[lines.len().saturating_sub(LAST_LINES)..].join("\n")
}

impl Service {
    /// Starts a program whose output goes into a file, after what is in it; its standard output too, unless `told` takes that.
    ///
    /// # Panics
    /// If it cannot be started.
    #[must_use]
    pub fn start(
        name: &'static str,
        command: &mut Command,
        log: &Path,
        told: Option<File>,
    ) -> Self {
        let open = || File::options().create(true).append(true).open(log);
        let said = || open().unwrap_or_else(|why| panic!("{}: {why}", log.display()));
        let child = command
            .stdout(told.unwrap_or_else(said))
            .stderr(said())
            .spawn()
            .unwrap_or_else(|why| panic!("{name}: {why}"));
        let inner = Arc::new(Mutex::new(Inner {
            name,
            child,
            log: log.to_owned(),
            may_end: false,
            killed: false,
        }));
        STARTED.with_borrow_mut(|started| {
            started.retain(|one| one.strong_count() > 0);
            started.push(Arc::downgrade(&inner));
        });
        Self(inner)
    }

    /// From now on it may end, if it ends well: as an X server does with its last client.
    pub fn may_end(&self) {
        lock(&self.0).may_end = true;
    }

    /// Whether it has not ended.
    ///
    /// # Panics
    /// If that cannot be found out.
    #[must_use]
    pub fn is_running(&self) -> bool {
        let ended = lock(&self.0).child.try_wait();
        ended.expect("a child can be asked").is_none()
    }

    /// How it died, if it did.
    #[must_use]
    pub fn death(&self) -> Option<Death> {
        lock(&self.0).death()
    }

    /// Its process.
    #[must_use]
    pub fn id(&self) -> u32 {
        lock(&self.0).child.id()
    }

    /// Sends it a signal.
    ///
    /// # Panics
    /// If it cannot be sent.
    pub fn signal(&self, signal: Signal) {
        let inner = lock(&self.0);
        kill_process(Pid::from_child(&inner.child), signal)
            .unwrap_or_else(|why| panic!("signalling {}: {why}", inner.name));
    }

    /// Waits until it has made something.
    ///
    /// # Errors
    /// The program's death.
    ///
    /// # Panics
    /// If it takes too long.
    pub fn wait_for<T>(&self, mut there: impl FnMut() -> Option<T>) -> Result<T, Death> {
        let begun = Instant::now();
        loop {
            if let Some(there) = there() {
                return Ok(there);
            }
            let mut inner = lock(&self.0);
            if let Some(death) = inner.death() {
                return Err(death);
            }
            let said = last_lines(&inner.log);
            assert!(
                begun.elapsed() < LONGEST_WAIT,
                "{} is late; it said last:\n{said}",
                inner.name
            );
            drop(inner);
            sleep(LOOK);
        }
    }

    /// Ends it as a crash would.
    pub fn kill(&self) {
        let mut inner = lock(&self.0);
        inner.killed = true;
        // It may have ended by itself.
        let _ = inner.child.kill();
        let _ = inner.child.wait();
    }

    /// Asks it to end, waits for that, and returns how it ended. One that does not is killed.
    ///
    /// # Panics
    /// If that cannot be found out.
    pub fn end(&self) -> ExitStatus {
        let mut inner = lock(&self.0);
        inner.killed = true;
        // It may have ended by itself.
        let _ = kill_process(Pid::from_child(&inner.child), Signal::TERM);
        let begun = Instant::now();
        loop {
            if let Some(status) = inner.child.try_wait().expect("a child can be asked") {
                return status;
            }
            if begun.elapsed() > LONGEST_WAIT / 4 {
                let _ = inner.child.kill();
            }
            sleep(LOOK);
        }
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        note_deaths();
        self.kill();
    }
}

/// Fails the test at once if a program that it started has died.
///
/// # Panics
/// If one has.
pub fn assert_all_live() {
    if let Some(death) = first_death() {
        panic!("{death}");
    }
}

fn first_death() -> Option<Death> {
    STARTED.with_borrow(|started| {
        let live = started.iter().filter_map(Weak::upgrade);
        live.map(|one| lock(&one).death()).find_map(|death| death)
    })
}

/// Remembers which program died, where the test is failing: before its own clearing up ends the others.
fn note_deaths() {
    if std::thread::panicking() {
        let death = first_death();
        DIED.with_borrow_mut(|died| *died = died.take().or(death));
    }
}

/// Runs a test that uses third-party programs; again where one of them died during it, twice at most.
///
/// # Panics
/// As the test does.
pub fn attended<T>(mut test: impl FnMut() -> T) -> T {
    for _ in 0..RESTARTS {
        DIED.set(None);
        match catch_unwind(AssertUnwindSafe(&mut test)) {
            Ok(come_to) => return come_to,
            Err(failure) => match DIED.take() {
                Some(death) => death.print_restart(),
                None => resume_unwind(failure),
            },
        }
    }
    test()
}

/// Starts something, and again where it died at its start, twice at most.
///
/// # Panics
/// If it died each time.
pub fn start<T>(mut begin: impl FnMut() -> Result<T, Death>) -> T {
    for _ in 0..RESTARTS {
        match begin() {
            Ok(begun) => return begun,
            Err(death) => death.print_restart(),
        }
    }
    begin().unwrap_or_else(|death| panic!("{death}"))
}

/// Runs a program to its end and returns its status and output.
///
/// # Panics
/// If it neither ends nor prints anything for too long.
#[must_use]
pub fn finish(command: &mut Command) -> Output {
    let folder = tempfile::tempdir().expect("a folder");
    let files = ["stdout", "stderr"].map(|name| folder.path().join(name));
    let [stdout, stderr] = files
        .each_ref()
        .map(|file| File::create(file).expect("a file"));
    let mut child = command
        .stdin(Stdio::null())
        .stdout(stdout)
        .stderr(stderr)
        .spawn()
        .unwrap_or_else(|why| panic!("{command:?}: {why}"));
    let size = || {
        let sizes = files.iter().flat_map(std::fs::metadata);
        sizes.map(|file| file.len()).sum::<u64>()
    };
    let mut heard = (0, Instant::now());
    loop {
        if let Some(status) = child.try_wait().expect("a child can be asked") {
            let [stdout, stderr] = files
                .each_ref()
                .map(std::fs::read)
                .map(Result::unwrap_or_default);
            return Output {
                status,
                stdout,
                stderr,
            };
        }
        let said = size();
        if said > heard.0 {
            heard = (said, Instant::now());
        }
        if heard.1.elapsed() > LONGEST_WAIT {
            let _ = child.kill();
            let _ = child.wait();
            let said = files.each_ref().map(|file| last_lines(file)).join("\n");
            panic!("{command:?} prints nothing more; its last output:\n{said}");
        }
        sleep(LOOK);
    }
}

/// A program that listens on a port of this machine, as soon as it does; killed when dropped.
pub fn listener(name: &'static str, command: &mut Command, port: u16, log: &Path) -> Service {
    start(|| {
        let service = Service::start(name, command.stdin(Stdio::null()), log, None);
        service.wait_for(|| TcpStream::connect(("127.0.0.1", port)).ok())?;
        Ok(service)
    })
}

/// The same of a third-party program, which is run again where a signal ended it, twice at most.
///
/// # Panics
/// If it dies each time.
#[must_use]
pub fn output(name: &'static str, command: &mut Command) -> Output {
    start(|| {
        let output = finish(command);
        if output.status.code().is_some() {
            return Ok(output);
        }
        Err(Death {
            name,
            status: output.status,
            said: String::from_utf8_lossy(&output.stderr).into_owned(),
        })
    })
}
