//! Other processes of this same program: a call's server, sender and receiver on one machine, as `demo` and `netlab` run them.

use anyhow::{Context, bail};
use link_http::Client;
use link_protocol::RoomLink;
use link_protocol::room_link::ServerUrl;
use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// A process that is asked to end may take so long: a receiver writes its pictures meanwhile.
const TO_END: Duration = Duration::from_secs(10);

/// A process that is ended when this is dropped.
#[derive(Debug)]
pub struct Process {
    name: &'static str,
    child: Child,
}

/// What becomes of a process' standard output.
#[derive(Debug)]
pub enum Output {
    /// It goes where this process' goes.
    Shown,
    /// It is not read.
    Dropped,
    /// It goes into this file, and so do errors and warnings.
    Kept(File),
}

impl Process {
    /// Starts `mon3tr NAME ARGUMENTS`.
    pub fn start<A: AsRef<OsStr>>(
        name: &'static str,
        arguments: impl IntoIterator<Item = A>,
        output: Output,
    ) -> anyhow::Result<Self> {
        Self::start_in(Vec::new(), name, arguments, output)
    }

    /// The same, with these variables in its environment.
    pub fn start_in<A: AsRef<OsStr>>(
        environment: Vec<(&'static str, OsString)>,
        name: &'static str,
        arguments: impl IntoIterator<Item = A>,
        output: Output,
    ) -> anyhow::Result<Self> {
        Self::start_with(name, arguments, output, environment)
    }

    /// Starts `mon3tr send ARGUMENTS` for the owner of this token, which does not show in the list of processes.
    pub fn start_sender(
        arguments: impl IntoIterator<Item = OsString>,
        owner_token: &str,
    ) -> anyhow::Result<Self> {
        let environment = vec![("MON3TR_OWNER_TOKEN", owner_token.into())];
        Self::start_with("send", arguments, Output::Dropped, environment)
    }

    fn start_with<A: AsRef<OsStr>>(
        name: &'static str,
        arguments: impl IntoIterator<Item = A>,
        output: Output,
        environment: Vec<(&'static str, OsString)>,
    ) -> anyhow::Result<Self> {
        let (stdout, stderr) = match output {
            Output::Shown => (Stdio::inherit(), Stdio::inherit()),
            Output::Dropped => (Stdio::null(), Stdio::inherit()),
            Output::Kept(file) => {
                let same = file
                    .try_clone()
                    .context("cannot share the file for output")?;
                (file.into(), same.into())
            }
        };
        Ok(Self {
            name,
            child: command(name, arguments)?
                .envs(environment)
                .stdout(stdout)
                .stderr(stderr)
                .spawn()
                .with_context(|| format!("cannot start `mon3tr {name}`"))?,
        })
    }

    /// The system's number of it.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for its end; an error if it failed or takes longer than `longest`.
    pub fn finish(self, longest: Option<Duration>) -> anyhow::Result<()> {
        self.finish_unless(longest, &AtomicBool::new(false))
    }

    /// The same; an error too if `stop` becomes true meanwhile.
    pub(crate) fn finish_unless(
        self,
        longest: Option<Duration>,
        stop: &AtomicBool,
    ) -> anyhow::Result<()> {
        self.finish_beside(longest, stop, || Ok(()))
    }

    /// The same; an error too if what is beside it has one. Where it does not come to its end it is asked to end: it keeps what it has
    /// until then.
    pub(crate) fn finish_beside(
        mut self,
        longest: Option<Duration>,
        stop: &AtomicBool,
        beside: impl FnMut() -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let name = self.name;
        let waited = self.wait_unless(longest, stop, beside);
        match waited {
            Ok(Some(status)) if status.success() => return Ok(()),
            Ok(Some(status)) => bail!("`mon3tr {name}` failed ({status})"),
            _ => self.stop()?,
        }
        waited?;
        if stop.load(Relaxed) {
            bail!("stopped before the end");
        }
        bail!("`mon3tr {name}` takes too long")
    }

    /// An error if it has failed, which it has told itself; that it has ended is none.
    ///
    /// # Errors
    /// As said.
    pub fn check(&mut self) -> anyhow::Result<()> {
        let name = self.name;
        let status = self.child.try_wait();
        match status.with_context(|| format!("cannot watch `mon3tr {name}`"))? {
            Some(status) if !status.success() => bail!(
                "the call is over, because `mon3tr {name}` failed ({status}); what it said is above"
            ),
            _ => Ok(()),
        }
    }

    /// Asks it to end, and makes it end if it does not.
    pub fn stop(mut self) -> anyhow::Result<()> {
        #[cfg(unix)]
        if let Err(error) = rustix::process::kill_process(
            rustix::process::Pid::from_child(&self.child),
            rustix::process::Signal::TERM,
        ) {
            log::debug!("`mon3tr {}` has ended already: {error}", self.name);
        }
        if self.wait(Some(TO_END))?.is_none() {
            log::warn!(
                "`mon3tr {}` did not end within {} s and is killed: it keeps nothing",
                self.name,
                TO_END.as_secs()
            );
        }
        Ok(())
    }

    fn wait(&mut self, longest: Option<Duration>) -> anyhow::Result<Option<ExitStatus>> {
        self.wait_unless(longest, &AtomicBool::new(false), || Ok(()))
    }

    fn wait_unless(
        &mut self,
        longest: Option<Duration>,
        stop: &AtomicBool,
        mut beside: impl FnMut() -> anyhow::Result<()>,
    ) -> anyhow::Result<Option<ExitStatus>> {
        let deadline = longest.map(|longest| Instant::now() + longest);
        loop {
            let status = self.child.try_wait();
            if let Some(status) =
                status.with_context(|| format!("cannot wait for `mon3tr {}`", self.name))?
            {
                return Ok(Some(status));
            }
            beside()?;
            let late = deadline.is_some_and(|deadline| Instant::now() >= deadline);
            if late || stop.load(Relaxed) {
                return Ok(None);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended long since.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn command<A: AsRef<OsStr>>(
    name: &str,
    arguments: impl IntoIterator<Item = A>,
) -> anyhow::Result<Command> {
    let mut command = match std::env::var_os("MON3TR_RUNNER").filter(|runner| !runner.is_empty()) {
        // Started through the wrapper this process is the wrapper's dynamic linker; its first argument is the program.
        Some(runner) => {
            let program = std::env::args_os().next();
            let mut command = Command::new(runner);
            command.arg(program.context("this program was started without its name")?);
            command
        }
        None => {
            Command::new(std::env::current_exe().context("cannot find this program's own file")?)
        }
    };
    command.arg(name).args(arguments).stdin(Stdio::null());
    end_with_this(&mut command);
    Ok(command)
}

/// Has a process asked to end when the thread that starts it ends, also where this process is killed and can do nothing about it any
/// more. A terminal's Ctrl-C then is for this process alone: one that is asked to end twice keeps nothing. Linux alone can do that.
pub(crate) fn end_with_this(command: &mut Command) {
    #[cfg(target_os = "linux")]
    {
        use rustix::process::{Signal, set_parent_process_death_signal};
        use std::os::unix::process::CommandExt;
        command.process_group(0);
        // SAFETY: between fork and exec only one system call is made, and nothing is allocated.
        unsafe {
            command.pre_exec(|| Ok(set_parent_process_death_signal(Some(Signal::TERM))?));
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = command;
}

/// A server on a free port of this machine alone.
#[derive(Debug)]
pub struct LocalServer {
    /// Its address.
    pub url: ServerUrl,
    /// What opens rooms there.
    pub owner_token: String,
    process: Process,
}

impl LocalServer {
    /// Starts one that keeps everything below `folder`.
    pub fn start(folder: &Path) -> anyhow::Result<Self> {
        let mut command = command("serve", ["--listen", "127.0.0.1:0", "--data"])?;
        let mut child = command
            .arg(folder)
            .stdout(Stdio::piped())
            .spawn()
            .context("cannot start `mon3tr serve`")?;
        let stdout = child.stdout.take();
        let process = Process {
            name: "serve",
            child,
        };
        let mut lines = BufReader::new(stdout.context("`mon3tr serve` has no output")?).lines();
        let first = lines
            .next()
            .transpose()
            .context("cannot read from `mon3tr serve`")?;
        let url = first
            .as_deref()
            .and_then(|line| line.strip_prefix("serving on "))
            .context("`mon3tr serve` did not start")?
            .parse()
            .context("`mon3tr serve` says no address")?;
        // It must never wait for a reader.
        std::thread::spawn(move || lines.for_each(drop));
        let file = folder.join("owner-token");
        let owner_token = std::fs::read_to_string(&file)
            .with_context(|| format!("cannot read {}", file.display()))?;
        Ok(Self {
            url,
            owner_token,
            process,
        })
    }

    /// Where it listens.
    pub fn address(&self) -> anyhow::Result<SocketAddr> {
        let text = self.url.to_string();
        let address = text.trim_start_matches("http://").trim_end_matches('/');
        address
            .parse()
            .with_context(|| format!("{text} is no address of this machine"))
    }

    /// Opens a room: the sender's link and the viewers'.
    pub async fn open_room(&self, client: &Client) -> anyhow::Result<(RoomLink, RoomLink)> {
        let room = client.open_room(&self.url, &self.owner_token, None).await?;
        Ok((room.sender, room.viewer))
    }

    /// The system's number of its process.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// An error if it has failed.
    ///
    /// # Errors
    /// As said.
    pub fn check(&mut self) -> anyhow::Result<()> {
        self.process.check()
    }

    /// Ends it.
    pub fn stop(self) -> anyhow::Result<()> {
        self.process.stop()
    }
}
