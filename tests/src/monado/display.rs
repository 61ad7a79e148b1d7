//! An X server without a screen.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use rustix::process::{Pid, Signal, kill_process};

/// It ends with this, and when its last client goes.
#[derive(Debug)]
pub(super) struct Display {
    server: Child,
    number: u32,
    /// Where it keeps what it shows.
    folder: PathBuf,
}

impl Display {
    /// Starts one and waits until it is there. It keeps its screen in `folder`.
    pub(super) fn start(prefix: &Path, folder: &Path) -> Self {
        let mut server = Command::new(prefix.join("xvfb"))
            .args([
                "-displayfd",
                "1",
                "-screen",
                "0",
                "1280x720x24",
                "-terminate",
                "-fbdir",
            ])
            .arg(folder)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|why| panic!("Xvfb: {why}"));
        let mut line = String::new();
        let told = server.stdout.take().expect("a pipe");
        // It says its number once it is ready, or ends.
        let read = BufReader::new(told).read_line(&mut line);
        let number = read.ok().and_then(|_| line.trim().parse().ok());
        Self {
            number: number.unwrap_or_else(|| panic!("Xvfb says {line:?}")),
            server,
            folder: folder.to_owned(),
        }
    }

    /// The file that is the screen, which the server writes as it draws.
    pub(super) fn screen(&self) -> PathBuf {
        self.folder.join("Xvfb_screen0")
    }

    /// For `DISPLAY`.
    pub(super) fn name(&self) -> String {
        format!(":{}", self.number)
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // Ended gently it takes its lock and its socket with it; it may have ended by itself.
        let _ = kill_process(Pid::from_child(&self.server), Signal::TERM);
        let _ = self.server.wait();
    }
}
