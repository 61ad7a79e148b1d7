//! The host process in the driver: requests, answers, and the log that the app writes.

use android_rehearsal::protocol::{
    ActivityIndex, Answer, Callback, Census, InputFigures, Intent, Reply, Request,
};
use anyhow::{Context, bail, ensure};
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use test_support::service::{LONGEST_WAIT, assert_all_live};

/// A process that has loaded the app.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    requests: ChildStdin,
    replies: Receiver<String>,
    logcat: PathBuf,
}

impl Process {
    /// Starts one: `command` is the host with its arguments and surroundings, `folder` gets the app's files and its log.
    pub(crate) fn start(mut command: Command, folder: &Path) -> anyhow::Result<Self> {
        let logcat = folder.join("logcat");
        let mut child = command
            .env("REHEARSAL_LOGCAT", &logcat)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(fs::File::create(folder.join("host.log"))?)
            .spawn()
            .context("the host could not be started")?;
        let requests = child.stdin.take().context("no pipe to the host")?;
        let stdout = child.stdout.take().context("no pipe from the host")?;
        let (sender, replies) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    return;
                }
            }
        });
        Ok(Self {
            child,
            requests,
            replies,
            logcat,
        })
    }

    fn request(&mut self, request: &Request) -> anyhow::Result<Reply> {
        let line = serde_json::to_string(request)?;
        // Where the process has ended, the missing answer's error says how.
        let _ = writeln!(self.requests, "{line}");
        match self.replies.recv_timeout(LONGEST_WAIT) {
            Ok(reply) => Ok(serde_json::from_str(&reply)?),
            Err(RecvTimeoutError::Timeout) => bail!(
                "the main thread has not come back from {request:?} for {} s",
                LONGEST_WAIT.as_secs()
            ),
            Err(RecvTimeoutError::Disconnected) => {
                let status = self.child.wait()?;
                bail!("the process ended ({status}) at {request:?}")
            }
        }
    }

    /// Creates an activity.
    pub(crate) fn create(&mut self, intent: Intent) -> anyhow::Result<ActivityIndex> {
        match self.request(&Request::Create(intent))?.answer {
            Answer::Created(index) => Ok(index),
            other => bail!("{other:?}"),
        }
    }

    /// Calls an activity back; returns for how long the main thread was blocked, milliseconds.
    pub(crate) fn call(
        &mut self,
        activity: ActivityIndex,
        callback: Callback,
    ) -> anyhow::Result<f64> {
        Ok(self
            .request(&Request::Callback(activity, callback))?
            .blocked_ms)
    }

    /// Several of them.
    pub(crate) fn calls(
        &mut self,
        activity: ActivityIndex,
        callbacks: &[Callback],
    ) -> anyhow::Result<()> {
        for callback in callbacks {
            self.call(activity, *callback)?;
        }
        Ok(())
    }

    /// All events that Android sends to an activity from a launch until it is in front.
    pub(crate) fn launch(&mut self, intent: Intent) -> anyhow::Result<ActivityIndex> {
        let activity = self.create(intent)?;
        self.calls(activity, &LAUNCH)?;
        Ok(activity)
    }

    /// All events that Android sends to one that is in front until it is gone.
    pub(crate) fn leave(&mut self, activity: ActivityIndex) -> anyhow::Result<()> {
        self.calls(activity, &LEAVE)
    }

    /// The state of `events` that were put into the activity's queue.
    pub(crate) fn input(
        &mut self,
        activity: ActivityIndex,
        events: u32,
    ) -> anyhow::Result<InputFigures> {
        match self.request(&Request::Input(activity, events))?.answer {
            Answer::Input(figures) => Ok(figures),
            other => bail!("{other:?}"),
        }
    }

    /// The census of the process now.
    pub(crate) fn census(&mut self) -> anyhow::Result<Census> {
        match self.request(&Request::Census)?.answer {
            Answer::Census(census) => Ok(*census),
            other => bail!("{other:?}"),
        }
    }

    /// The app's log so far.
    pub(crate) fn logcat(&self) -> String {
        let bytes = fs::read(&self.logcat).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// Lines of the log with `text`.
    pub(crate) fn logged(&self, text: &str) -> usize {
        let logcat = self.logcat();
        logcat.lines().filter(|line| line.contains(text)).count()
    }

    /// The lines of the log that tell of an error or a panic, if there are any.
    pub(crate) fn trouble(&self) -> Option<String> {
        let logcat = self.logcat();
        let lines = logcat.lines().filter(|line| line.contains(" E mon3tr"));
        let lines: Vec<&str> = lines.collect();
        (!lines.is_empty()).then(|| lines.join("\n"))
    }

    /// Waits until so many lines of the log have `text`.
    pub(crate) fn wait_for(&mut self, text: &str, times: usize) -> anyhow::Result<()> {
        self.wait_until(&format!("{times} times `{text}` in the log"), |this| {
            Ok(this.logged(text) >= times)
        })
    }

    /// Waits until a condition holds; not longer than [`LONGEST_WAIT`], nor than the process lives.
    pub(crate) fn wait_until(
        &mut self,
        what: &str,
        mut is_so: impl FnMut(&mut Self) -> anyhow::Result<bool>,
    ) -> anyhow::Result<()> {
        let begun = Instant::now();
        loop {
            if is_so(self)? {
                return Ok(());
            }
            if let Some(status) = self.child.try_wait()? {
                bail!("the process ended ({status}) while {what} was waited for");
            }
            // The death of a headset's runtime is no fault of the app: it is named, and the case performed again.
            assert_all_live();
            if let Some(trouble) = self.trouble() {
                bail!("trouble while {what} was waited for:\n{trouble}");
            }
            ensure!(begun.elapsed() < LONGEST_WAIT, "waited in vain for {what}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits for the process's own end; nothing if it does not end within `longest`.
    pub(crate) fn ends_itself(&mut self, longest: Duration) -> anyhow::Result<Option<ExitStatus>> {
        let begun = Instant::now();
        loop {
            let ended = self.child.try_wait()?;
            if ended.is_some() || begun.elapsed() > longest {
                return Ok(ended);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Ends the process, which must be able to end.
    pub(crate) fn quit(mut self) -> anyhow::Result<()> {
        let line = serde_json::to_string(&Request::Quit)?;
        writeln!(self.requests, "{line}").context("the process has ended before")?;
        let status = self.ends_itself(LONGEST_WAIT)?;
        let status = status.context("the process does not end")?;
        ensure!(status.success(), "the process ended badly: {status}");
        Ok(())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// In Android's order.
pub(crate) const LAUNCH: [Callback; 5] = [
    Callback::Start,
    Callback::Resume,
    Callback::InputQueueCreated,
    Callback::NativeWindowCreated,
    Callback::FocusGained,
];

/// In Android's order.
pub(crate) const LEAVE: [Callback; 6] = [
    Callback::Pause,
    Callback::FocusLost,
    Callback::NativeWindowDestroyed,
    Callback::Stop,
    Callback::InputQueueDestroyed,
    Callback::Destroy,
];
