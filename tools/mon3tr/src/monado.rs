//! A Monado of this program's own, where no `OpenXR` runtime is active: a real runtime with a simulated headset, so that
//! `--display xr` can be seen to work on any machine.

use crate::children::end_with_this;
use anyhow::{Context, bail};
use std::ffi::OsString;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The folder of Monado's programs; `./run` fetches it.
const FOLDER: &str = "MON3TR_MONADO";
/// How long it may take to start.
const PATIENCE: Duration = Duration::from_secs(30);
/// Between two looks whether it has.
const LOOK: Duration = Duration::from_millis(50);
/// Where it listens, below its runtime directory.
const SOCKET: &str = "monado_comp_ipc";

/// Where runtimes announce themselves as the active one, below a folder of configuration.
const ACTIVE: &str = "openxr/1/active_runtime.json";

/// A running service, with a runtime directory of its own; both go when this is dropped.
#[derive(Debug)]
pub struct Monado {
    service: Child,
    folder: TempDir,
    log: PathBuf,
    programs: PathBuf,
}

/// Whether a runtime is active on this machine: a headset's own software.
pub(crate) fn is_another_active() -> bool {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    if variable("XR_RUNTIME_JSON").is_some() {
        return true;
    }
    let home = variable("XDG_CONFIG_HOME")
        .map(PathBuf::from)
        .or_else(|| variable("HOME").map(|home| Path::new(&home).join(".config")));
    let everybody = ["/etc/xdg", "/etc", "/usr/local/etc", "/usr/share"].map(PathBuf::from);
    (home.into_iter().chain(everybody)).any(|folder| folder.join(ACTIVE).exists())
}

impl Monado {
    /// Starts the service with a simulated headset, and waits until it listens.
    ///
    /// # Errors
    /// If there is none here, or it does not start.
    pub fn start() -> anyhow::Result<Self> {
        let Some(programs) = std::env::var_os(FOLDER).filter(|folder| !folder.is_empty()) else {
            bail!(
                "no OpenXR runtime is active, and there is no Monado to start instead: start through ./run, which fetches it, \
                 or make a headset's runtime the active one"
            );
        };
        let programs = PathBuf::from(programs);
        let folder = tempfile::Builder::new()
            .prefix("mon3tr-xr-")
            .tempdir()
            .context("cannot make a runtime directory for Monado")?;
        let log = folder.path().join("log");
        let mut monado = Self {
            service: launch(&programs, folder.path(), &log)?,
            folder,
            log,
            programs,
        };
        monado.wait()?;
        Ok(monado)
    }

    /// Ends the service as a crash would.
    pub fn kill(&mut self) {
        // It may have ended with its last client.
        let _ = self.service.kill();
        let _ = self.service.wait();
    }

    /// Starts it again after [`Self::kill`], where its clients look for it.
    ///
    /// # Errors
    /// If it does not start.
    pub fn restart(&mut self) -> anyhow::Result<()> {
        self.kill();
        // One that was killed leaves its own, which is not to be taken for the new one's.
        match std::fs::remove_file(self.folder.path().join(SOCKET)) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(error).context("cannot remove the socket of the Monado before");
            }
            _ => {}
        }
        self.service = launch(&self.programs, self.folder.path(), &self.log)?;
        self.wait()
    }

    fn wait(&mut self) -> anyhow::Result<()> {
        let deadline = Instant::now() + PATIENCE;
        let socket = self.folder.path().join(SOCKET);
        while !socket.exists() {
            let ended = self.service.try_wait().context("cannot watch Monado")?;
            if ended.is_some() || Instant::now() >= deadline {
                let how = ended.map_or_else(String::new, |status| format!(" ({status})"));
                bail!(
                    "Monado does not start{how}; it said last:\n{}",
                    self.last_words()
                );
            }
            std::thread::sleep(LOOK);
        }
        Ok(())
    }

    /// An error if it has died. That it ends with its last client is well.
    pub(crate) fn check(&mut self) -> anyhow::Result<()> {
        match self.service.try_wait().context("cannot watch Monado")? {
            Some(status) if !status.success() => bail!(
                "Monado has ended by itself ({status}); it said last:\n{}",
                self.last_words()
            ),
            _ => Ok(()),
        }
    }

    fn last_words(&self) -> String {
        let text = std::fs::read_to_string(&self.log).unwrap_or_default();
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(5)..].join("\n")
    }

    /// What a program finds it by.
    #[must_use]
    pub fn environment(&self) -> Vec<(&'static str, OsString)> {
        vec![
            ("XDG_RUNTIME_DIR", self.folder.path().into()),
            (
                "XR_RUNTIME_JSON",
                self.programs.join("openxr_monado.json").into(),
            ),
            // The runtime's library tells much that is of use to its authors.
            ("XRT_LOG", "warn".into()),
            ("OXR_NO_PRINTING_STDERR", "1".into()),
        ]
    }
}

impl Drop for Monado {
    fn drop(&mut self) {
        self.kill();
    }
}

fn launch(programs: &Path, folder: &Path, log: &Path) -> anyhow::Result<Child> {
    let open = || {
        let file = File::options().create(true).append(true).open(log);
        file.context("cannot write Monado's log")
    };
    let program = programs.join("run");
    let mut command = Command::new(&program);
    end_with_this(&mut command);
    command
        .env("XDG_RUNTIME_DIR", folder)
        .env("XDG_CONFIG_HOME", folder)
        // What it composes is shown nowhere.
        .env("XRT_COMPOSITOR_NULL", "1")
        .env("SIMULATED_ENABLE", "1")
        .env("SIMULATED_LEFT", "simple")
        .env("SIMULATED_RIGHT", "simple")
        .env("XRT_NO_STDIN", "1")
        // It ends with the one who used it, even if this process is killed.
        .env("IPC_EXIT_ON_DISCONNECT", "1")
        .stdin(Stdio::null())
        .stdout(open()?)
        .stderr(open()?)
        .spawn()
        .with_context(|| format!("cannot start Monado ({})", program.display()))
}
