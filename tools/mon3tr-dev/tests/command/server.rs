//! A server of the test's own.

use crate::support::{Outcome, command, puppet, text};
use link_protocol::RoomLink;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;
use tempfile::TempDir;
use test_support::program::Program;

/// A server, and what it keeps.
pub(crate) struct Server {
    program: Program,
    pub(crate) url: String,
    pub(crate) folder: TempDir,
}

impl Server {
    pub(crate) fn start(arguments: &[&str]) -> Self {
        Self::start_in(tempfile::tempdir().expect("a folder"), arguments)
    }

    pub(crate) fn start_in(folder: TempDir, arguments: &[&str]) -> Self {
        let data = folder.path().join("data");
        let first = ["serve", "--listen", "127.0.0.1:0", "--data", text(&data)];
        let mut program = Program::start(&mut command(&[&first, arguments].concat()));
        let url = program.word_after("serving on ");
        Self {
            program,
            url,
            folder,
        }
    }

    /// As `kill -9`; what it kept stays.
    pub(crate) fn kill(self) -> TempDir {
        self.folder
    }

    /// That it has not ended.
    pub(crate) fn assert_runs(&mut self) {
        let ended = self.program.ended_within(Duration::ZERO);
        assert!(
            ended.is_none(),
            "the server has ended:\n{}",
            self.program.said()
        );
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn token(&self) -> String {
        let token = std::fs::read_to_string(self.path("data/owner-token"));
        token.expect("the server has made one").trim().to_owned()
    }

    /// The owner's command with these arguments.
    pub(crate) fn owner(&self, arguments: &[&str]) -> Command {
        let mut command = command(arguments);
        command
            .env("MON3TR_OWNER_TOKEN", self.token())
            .env("MON3TR_CACHE", self.path("cache"));
        command
    }

    pub(crate) fn canary(&self, arguments: &[&str]) -> Outcome {
        let first = ["canary", &self.url];
        Outcome::of(&mut self.owner(&[&first, arguments].concat()))
    }

    /// A sender in a room of its own, and its viewers' link.
    pub(crate) fn sender(&self) -> (Program, RoomLink) {
        let avatar = puppet(&self.folder);
        let arguments = ["send", "--server", &self.url, "--avatar", text(&avatar)];
        let mut program = Program::start(&mut self.owner(&arguments));
        let link = program.word_after("mon3tr receive ");
        (program, link.parse().expect("a link"))
    }
}
