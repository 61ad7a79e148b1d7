//! Running the command from a test. Which program it is, the test says in its root: `PROGRAM`.

use std::path::{Path, PathBuf};
use std::process::Command;
use synthetic_person::Puppet;
use tempfile::TempDir;
use test_support::program::through_runner;

/// How the command ended.
pub(crate) struct Outcome {
    ok: bool,
    stdout: String,
    stderr: String,
}

/// `mon3tr` with `arguments`, through `MON3TR_RUNNER` where the machine's C library is too old for the Vulkan driver.
pub(crate) fn command(arguments: &[&str]) -> Command {
    let mut command = through_runner(crate::PROGRAM);
    command.args(arguments);
    // Not of whoever runs the tests.
    command.env("MON3TR_KEY", concat!(env!("CARGO_TARGET_TMPDIR"), "/key"));
    command
}

/// Runs `mon3tr` with `arguments`.
pub(crate) fn mon3tr(arguments: &[&str]) -> Outcome {
    Outcome::of(&mut command(arguments))
}

impl Outcome {
    pub(crate) fn of(command: &mut Command) -> Self {
        let output = test_support::service::finish(command);
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Self {
            ok: output.status.success(),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }

    /// Standard output of a run that must have ended well.
    pub(crate) fn succeeds(self) -> String {
        assert!(self.ok, "the command failed:\n{}", self.stderr);
        self.stdout
    }

    /// The run must have failed without a panic, with one `error:` line that holds all of `words`.
    pub(crate) fn fails_naming(self, words: &[&str]) {
        assert!(
            !self.ok,
            "the command must fail, but printed:\n{}",
            self.stdout
        );
        assert!(
            !self.stderr.contains("panicked"),
            "the command panicked:\n{}",
            self.stderr
        );
        let line = self.stderr.lines().find(|line| line.starts_with("error:"));
        assert!(
            line.is_some(),
            "no line starts with `error:` in:\n{}",
            self.stderr
        );
        for word in words {
            assert!(
                line.is_some_and(|line| line.contains(word)),
                "`{word}` is missing in:\n{}",
                self.stderr
            );
        }
    }
}

/// The JSON in `path`.
pub(crate) fn json(path: &Path) -> serde_json::Value {
    let text = std::fs::read_to_string(path).expect("the JSON file exists");
    serde_json::from_str(&text).expect("the JSON file is JSON")
}

/// The made-up person's package, written into `folder`.
pub(crate) fn puppet(folder: &TempDir) -> PathBuf {
    let package = folder.path().join("puppet.m3a");
    Puppet::small()
        .avatar()
        .save(&package)
        .expect("the made-up person fits a package");
    package
}

/// A path as an argument.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("temporary paths are UTF-8")
}
