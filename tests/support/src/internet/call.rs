//! Calls between homes: a server with a relay, senders and viewers, all of them real processes.

use super::{Home, Internet, Namespace, OTHER_SERVER, SERVER};
use crate::program::{Program, through_runner};
use serde_json::Value;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::Duration;
use synthetic_person::Puppet;
use tempfile::TempDir;

/// A `serve --turn` in the public network of an internet, and a package to send.
#[derive(Debug)]
pub struct CallWorld {
    // Dropped in this order: programs end before their network does and their files go.
    _server: Program,
    internet: Internet,
    folder: TempDir,
    mon3tr: PathBuf,
    avatar: PathBuf,
    files: Cell<u32>,
}

/// A sender that waits for viewers.
#[derive(Debug)]
pub struct Sending {
    /// The process.
    pub program: Program,
    /// With which viewers join.
    pub link: String,
    report: PathBuf,
}

/// A viewer.
#[derive(Debug)]
pub struct Receiving {
    /// The process.
    pub program: Program,
    report: PathBuf,
}

impl CallWorld {
    /// With this `mon3tr`; nothing, and a line that says why, where [`Internet::open`] gives none.
    ///
    /// # Panics
    /// If the server does not start, and as [`Internet::open`].
    #[must_use]
    pub fn open(mon3tr: &Path) -> Option<Self> {
        let internet = Internet::open()?;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let avatar = folder.path().join("puppet.m3a");
        Puppet::small()
            .avatar()
            .save(&avatar)
            .expect("the made-up person fits a package");
        let data = folder.path().join("server");
        let mut serve = mon3tr_command(mon3tr, folder.path());
        serve
            .args([
                "serve",
                "--insecure",
                "--listen",
                "0.0.0.0:8080",
                "--turn",
                "0.0.0.0:3478",
            ])
            .arg("--data")
            .arg(data);
        let mut server = Program::start(&mut internet.server().enter(&serve));
        server.says("serving on http://", 1);
        Some(Self {
            _server: server,
            internet,
            folder,
            mon3tr: mon3tr.to_owned(),
            avatar,
            files: Cell::new(0),
        })
    }

    /// The networks.
    pub fn internet(&mut self) -> &mut Internet {
        &mut self.internet
    }

    /// `send` from a home, into a new room, with these arguments.
    ///
    /// # Panics
    /// If it does not open a room.
    #[must_use]
    pub fn send(&self, home: &Home, arguments: &[&str]) -> Sending {
        let token = std::fs::read_to_string(self.folder.path().join("server/owner-token"));
        let token = token.expect("the server has left it there");
        let (mut send, report) = self.command("send");
        send.args(["--insecure", "--owner-token", token.trim(), "--avatar"])
            .arg(&self.avatar)
            .args(["--server", &format!("http://{SERVER}:8080")])
            .args(arguments);
        let mut program = start(home.machine(), &send);
        let link = program.word_after("mon3tr receive ");
        Sending {
            program,
            link,
            report,
        }
    }

    /// `receive` in a home, with these arguments and a cache of its own; it draws nothing.
    #[must_use]
    pub fn receive(&self, home: &Home, link: &str, arguments: &[&str]) -> Receiving {
        let (mut receive, report) = self.command("receive");
        receive
            .args([link, "--insecure", "--display", "none"])
            .args(arguments)
            .env("MON3TR_CACHE", report.with_extension("cache"));
        Receiving {
            program: start(home.machine(), &receive),
            report,
        }
    }

    /// `call` in a home, with these arguments, started as `command` says, with a cache of its own: the one who opens a call, or with a `link` one who joins.
    ///
    /// # Panics
    /// If the owner's token is not there.
    #[must_use]
    pub fn call(
        &self,
        home: &Home,
        link: Option<&str>,
        arguments: &[&str],
        command: &mut Command,
    ) -> Receiving {
        let number = self.files.get();
        self.files.set(number + 1);
        let report = self.folder.path().join(format!("call-{number}.json"));
        as_mon3tr(command, &report.with_extension("cache"));
        command.args(["call", "--insecure", "--json"]).arg(&report);
        match link {
            Some(link) => command.arg(link),
            None => {
                let token = std::fs::read_to_string(self.folder.path().join("server/owner-token"));
                let token = token.expect("the server has left it there");
                command
                    .args(["--owner-token", token.trim()])
                    .args(["--server", &format!("http://{SERVER}:8080")])
            }
        };
        command.args(arguments);
        Receiving {
            program: start(home.machine(), command),
            report,
        }
    }

    /// `doctor` in a home, with a second STUN server to ask on the server's machine: its figures, and what it says.
    ///
    /// # Panics
    /// If it fails.
    #[must_use]
    pub fn doctor(&self, home: &Home) -> (Value, String) {
        let other = self.folder.path().join("other");
        let mut serve = mon3tr_command(&self.mon3tr, self.folder.path());
        serve.args([
            "serve",
            "--listen",
            "127.0.0.1:0",
            "--turn",
            &format!("{OTHER_SERVER}:3479"),
        ]);
        serve.arg("--data").arg(other);
        let mut other = Program::start(&mut self.internet.server().enter(&serve));
        other.says("serving on http://", 1);
        let (mut command, report) = self.command("doctor");
        let token = std::fs::read_to_string(self.folder.path().join("server/owner-token"));
        command
            .args([
                "--owner-token",
                token.expect("the server has left it there").trim(),
            ])
            .args(["--server", &format!("http://{SERVER}:8080")])
            .args(["--stun", &format!("{OTHER_SERVER}:3479")]);
        let output = home.machine().enter(&command).output();
        let output = output.expect("it can be started");
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let complaints = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{said}{complaints}");
        let figures = std::fs::read(report).expect("a report");
        (serde_json::from_slice(&figures).expect("JSON"), said)
    }

    /// A sub-command that writes its figures, and where.
    fn command(&self, name: &str) -> (Command, PathBuf) {
        let number = self.files.get();
        self.files.set(number + 1);
        let report = self.folder.path().join(format!("{name}-{number}.json"));
        let mut command = mon3tr_command(&self.mon3tr, self.folder.path());
        command.arg(name).arg("--json").arg(&report);
        (command, report)
    }
}

impl Sending {
    /// Has it hang up, and returns its figures.
    ///
    /// # Panics
    /// If it does not end well.
    pub fn hang_up(&mut self) -> Value {
        let status = self.program.end();
        let figures = figures(&self.program, status, &self.report);
        figures.unwrap_or_else(|why| panic!("{why}"))
    }

    /// Waits until it has hung up by itself, and returns its figures, or all that it said, where it failed; nothing if it has not ended by
    /// then.
    pub fn outcome(&mut self, longest: Duration) -> Option<Result<Value, String>> {
        let status = self.program.ended_within(longest)?;
        Some(figures(&self.program, status, &self.report))
    }
}

impl Receiving {
    /// The figures of its call, when that is over, or all that it said, where it failed; nothing if it is not over by then.
    pub fn outcome(&mut self, longest: Duration) -> Option<Result<Value, String>> {
        let figures = self.all_figures(longest)?;
        Some(figures.map(|mut figures| figures["call"].take()))
    }

    /// The same with every figure.
    pub fn all_figures(&mut self, longest: Duration) -> Option<Result<Value, String>> {
        let status = self.program.ended_within(longest)?;
        Some(figures(&self.program, status, &self.report))
    }
}

/// `mon3tr` through `MON3TR_RUNNER`, if there is one, with files below `folder` and without sound.
fn mon3tr_command(mon3tr: &Path, folder: &Path) -> Command {
    let mut command = through_runner(mon3tr);
    as_mon3tr(&mut command, &folder.join("cache"));
    command
}

fn as_mon3tr(command: &mut Command, cache: &Path) {
    command
        .env("MON3TR_CACHE", cache)
        .env("MON3TR_KEY", cache.join("key"))
        .env("PULSE_SERVER", "unix:/no-sound-server")
        .env("RUST_LOG", "link=info")
        .env_remove("MON3TR_OWNER_TOKEN");
}

fn start(place: &Namespace, command: &Command) -> Program {
    let mut command = place.enter(command);
    Program::start(command.stdin(Stdio::null()))
}

fn figures(program: &Program, status: ExitStatus, report: &Path) -> Result<Value, String> {
    let said = program.said();
    if !status.success() || said.contains("panicked") {
        return Err(format!("it failed ({status}):\n{said}"));
    }
    let text = std::fs::read_to_string(report);
    let text = text.map_err(|why| format!("{}: {why}:\n{said}", report.display()))?;
    serde_json::from_str(&text).map_err(|why| format!("{}: {why}", report.display()))
}
