//! A program as a child process: its output is kept, and it ends with its owner.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

use crate::service::LONGEST_WAIT;

/// `program` as programs with a Vulkan device are started: through what `MON3TR_RUNNER` names, if it names something, where the machine's C library
/// is too old for the driver.
#[must_use]
pub fn through_runner(program: impl AsRef<OsStr>) -> Command {
    match std::env::var_os("MON3TR_RUNNER") {
        Some(runner) if !runner.is_empty() => {
            let mut command = Command::new(runner);
            command.arg(program);
            command
        }
        _ => Command::new(program),
    }
}

/// A program that runs; killed where it has not ended before.
#[derive(Debug)]
pub struct Program {
    child: Child,
    said: Arc<Mutex<String>>,
    listeners: Vec<JoinHandle<()>>,
}

impl Program {
    /// Starts it. Its standard input and its environment are the command's.
    ///
    /// # Panics
    /// If it cannot be started.
    #[must_use]
    pub fn start(command: &mut Command) -> Self {
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap_or_else(|why| panic!("{command:?}: {why}"));
        let said = Arc::<Mutex<String>>::default();
        let listeners = vec![
            listen(child.stdout.take().expect("piped"), &said),
            listen(child.stderr.take().expect("piped"), &said),
        ];
        Self {
            child,
            said,
            listeners,
        }
    }

    /// The system's number of it.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// The memory that it has now, bytes.
    ///
    /// # Panics
    /// If it has ended.
    #[must_use]
    pub fn resident_memory(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.id()));
        let status = status.expect("it runs");
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB"));
        let kilobytes = kilobytes.and_then(|it| it.trim().parse::<u64>().ok());
        kilobytes.expect("a size") << 10
    }

    /// All that it has printed and logged so far.
    #[must_use]
    pub fn said(&self) -> String {
        let said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        said.clone()
    }

    /// Waits until it has said `words` in so many lines.
    ///
    /// # Panics
    /// If it ends before, or does not say so within [`LONGEST_WAIT`].
    pub fn says(&mut self, words: &str, times: usize) {
        let begun = Instant::now();
        loop {
            let said = self.said();
            if said.lines().filter(|line| line.contains(words)).count() >= times {
                return;
            }
            let ended = self.child.try_wait().expect("a child can be asked");
            assert!(
                ended.is_none(),
                "it ended ({ended:?}) before it said `{words}` {times} times:\n{said}"
            );
            assert!(
                begun.elapsed() < LONGEST_WAIT,
                "it did not say `{words}` {times} times:\n{said}"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits for `words`, and returns the word that follows them.
    ///
    /// # Panics
    /// As [`Self::says`].
    pub fn word_after(&mut self, words: &str) -> String {
        self.says(words, 1);
        let said = self.said();
        let rest = said.split_once(words).expect("it was said").1;
        let word = rest.split_whitespace().next().expect("something follows");
        word.trim_matches('\'').to_owned()
    }

    /// Asks it to end, as Ctrl-C does.
    pub fn ask_to_end(&self) {
        // It may have ended by itself.
        let _ = kill_process(Pid::from_child(&self.child), Signal::TERM);
    }

    /// The same, and waits for its end.
    ///
    /// # Panics
    /// If it does not end within [`LONGEST_WAIT`].
    pub fn end(&mut self) -> ExitStatus {
        self.ask_to_end();
        self.ended_within(LONGEST_WAIT)
            .unwrap_or_else(|| panic!("it does not end:\n{}", self.said()))
    }

    /// Waits for its end; nothing if it has not come by then.
    ///
    /// # Panics
    /// If that cannot be found out.
    pub fn ended_within(&mut self, longest: Duration) -> Option<ExitStatus> {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().expect("a child can be asked") {
                for listener in self.listeners.drain(..) {
                    let _ = listener.join();
                }
                return Some(status);
            }
            if begun.elapsed() >= longest {
                return None;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Keeps a process's output, line by line, so that it never waits for a reader.
fn listen(stream: impl Read + Send + 'static, said: &Arc<Mutex<String>>) -> JoinHandle<()> {
    let said = Arc::clone(said);
    std::thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
            said.push_str(&line);
            said.push('\n');
        }
    })
}
