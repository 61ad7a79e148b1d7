//! An X server without a screen.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::service::{Death, Service};

/// It ends with this, and when its last client goes.
#[derive(Debug)]
pub(super) struct Display {
    server: Service,
    number: u32,
    /// Where it keeps what it shows.
    folder: PathBuf,
}

impl Display {
    /// Starts one, with a place for its files and its screen, and waits until it is there.
    pub(super) fn start(prefix: &Path, place: &Path) -> Result<Self, Death> {
        let told = place.join("display");
        let out = File::create(&told).unwrap_or_else(|why| panic!("{}: {why}", told.display()));
        let mut command = Command::new(prefix.join("xvfb"));
        command
            .args([
                "-displayfd",
                "1",
                "-screen",
                "0",
                "1280x720x24",
                "-terminate",
                "-fbdir",
            ])
            .arg(place)
            .stdin(Stdio::null());
        let log = place.join("display.log");
        let server = Service::start("Xvfb", &mut command, &log, Some(out));
        // It says its number, on a line, once it is ready.
        let number = server.wait_for(|| {
            let line = std::fs::read_to_string(&told).ok()?;
            line.strip_suffix('\n')?.trim().parse().ok()
        })?;
        server.may_end();
        Ok(Self {
            server,
            number,
            folder: place.to_owned(),
        })
    }

    /// The file that is the screen, which the server writes as it draws.
    pub(super) fn screen(&self) -> PathBuf {
        self.folder.join("Xvfb_screen0")
    }

    /// For `DISPLAY`.
    pub(super) fn name(&self) -> String {
        format!(":{}", self.number)
    }

    pub(super) fn service(&self) -> &Service {
        &self.server
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        // Ended gently it takes its lock and its socket with it.
        self.server.end();
    }
}
