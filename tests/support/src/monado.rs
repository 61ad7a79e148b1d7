//! Monado, a real `OpenXR` runtime, for one test: its service in a runtime directory of its own, with a scripted head or one that
//! moves by itself, and a display of its own where one is wanted. What a client needs to find it is set on the client's command.
//! A service that dies is noticed and started again as [`crate::service`] says.
//!
//! `MON3TR_MONADO` names the folder it lies in (see `./run`).

mod display;
mod head;

use std::ffi::{OsStr, OsString};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use rustix::process::Signal;
use tempfile::TempDir;

use crate::program::through_runner;
use crate::service::{self, Death, Service};
use display::Display;
pub use head::{Controller, Eye, Head, Pose, Scripted};

/// The simulated headset of the service.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Driver {
    /// A head that sways by itself, with no hands.
    Simulated,
    /// One that a test moves: see [`Monado::head`].
    Remote,
}

/// The service's display.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compositor {
    /// Nowhere, 20 times a second.
    Null,
    /// In a window of an X server without a screen, 72 times a second: what a real headset's compositor does.
    Window,
}

/// Where the service listens below its runtime directory.
const SOCKET: &str = "monado_comp_ipc";

/// A service and its runtime directory. It ends with this, and with the process that started it.
#[derive(Debug)]
pub struct Monado {
    prefix: PathBuf,
    driver: Driver,
    /// Port of the remote driver.
    port: u16,
    /// What the service's environment has besides.
    environment: Vec<(OsString, OsString)>,
    service: Option<Service>,
    display: Option<Display>,
    // Dropped last: the service's files lie in it.
    place: TempDir,
}

impl Monado {
    /// A runtime directory for a service that is not started yet; nothing, after a line that says why, where there is no Monado. On CI that
    /// is a failure.
    #[must_use]
    pub fn place(driver: Driver, compositor: Compositor) -> Option<Self> {
        let found = prefix().and_then(|prefix| {
            if compositor == Compositor::Window && !prefix.join("xvfb").exists() {
                return Err(format!("no xvfb in {}", prefix.display()));
            }
            Ok(prefix)
        });
        let prefix = or_skip(found)?;
        let place = short_folder();
        let runtime = place.path().join("run");
        let config = place.path().join("config/monado");
        make_private(&runtime);
        std::fs::create_dir_all(&config).expect("a folder for the configuration");
        let display = (compositor == Compositor::Window)
            .then(|| service::start(|| Display::start(&prefix, place.path())));
        Some(Self {
            prefix,
            driver,
            port: 0,
            environment: Vec::new(),
            service: None,
            display,
            place,
        })
    }

    /// A service that runs; nothing, after a line that says why, where there is no Monado. On CI that is a failure.
    #[must_use]
    pub fn start(driver: Driver, compositor: Compositor) -> Option<Self> {
        Self::start_with(driver, compositor, Vec::new())
    }

    /// The same, with variables set in the service's environment.
    #[must_use]
    pub fn start_with(
        driver: Driver,
        compositor: Compositor,
        environment: Vec<(OsString, OsString)>,
    ) -> Option<Self> {
        let mut monado = Self::place(driver, compositor)?;
        monado.environment = environment;
        monado.restart();
        Some(monado)
    }

    /// Starts the service, for the first time or after [`Self::kill`], in the same runtime directory.
    ///
    /// # Panics
    /// If it does not come up.
    pub fn restart(&mut self) {
        self.kill();
        for _ in 0..3 {
            self.port = free_port();
            let said = self.log().len();
            let service = service::start(|| self.launch());
            self.service = Some(service);
            // Another process may have taken the port since it was free; then the service goes on without its driver.
            if self.driver == Driver::Simulated || !self.log()[said..].contains("bind: -1") {
                return;
            }
            self.kill();
        }
        panic!("no port for the remote driver:\n{}", self.log());
    }

    fn launch(&self) -> Result<Service, Death> {
        let remote = format!(
            r#"{{"active":"remote","remote":{{"version":0,"port":{},"view_count":2}}}}"#,
            self.port
        );
        let config = self.place.path().join("config/monado/config_v0.json");
        if self.driver == Driver::Remote {
            std::fs::write(config, remote).expect("a file for the configuration");
        }
        let socket = self.runtime_directory().join(SOCKET);
        // A service that was killed leaves its own.
        let _ = std::fs::remove_file(&socket);
        let mut command = Command::new(self.prefix.join("run"));
        command
            .env("XDG_RUNTIME_DIR", self.runtime_directory())
            .env("XDG_CONFIG_HOME", self.place.path().join("config"))
            .env("HOME", self.place.path())
            .env("XRT_LOG", "warn")
            .env_remove("SIMULATED_ENABLE")
            .env_remove("XRT_NO_STDIN")
            .env_remove("XRT_COMPOSITOR_NULL")
            .env_remove("DISPLAY")
            .env_remove("WAYLAND_DISPLAY")
            // It ends when something comes in there: with our end of the pipe, which closes with this process at the latest.
            .envs(self.environment.iter().map(|(name, value)| (name, value)))
            .stdin(Stdio::piped());
        if self.driver == Driver::Simulated {
            command.env("SIMULATED_ENABLE", "1");
        }
        match &self.display {
            None => command.env("XRT_COMPOSITOR_NULL", "1"),
            Some(display) => command
                .env("DISPLAY", display.name())
                .env("XRT_COMPOSITOR_FORCE_XCB", "1")
                .env("XRT_COMPOSITOR_DEFAULT_FRAMERATE", "72")
                .env("XRT_COMPOSITOR_SCALE_PERCENTAGE", "50"),
        };
        let service = Service::start("Monado", &mut command, &self.log_file(), None);
        service.wait_for(|| socket.exists().then_some(()))?;
        Ok(service)
    }

    /// A program that finds this service, started as programs here are. Its arguments, and what it does with its streams, are the
    /// caller's.
    #[must_use]
    pub fn client(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = through_runner(program);
        command
            .env("XDG_RUNTIME_DIR", self.runtime_directory())
            .env("XDG_CONFIG_HOME", self.place.path().join("config"))
            .env("XR_RUNTIME_JSON", self.prefix.join("openxr_monado.json"))
            .env("MON3TR_MONADO", &self.prefix)
            .env("XRT_LOG", "warn")
            .env("OXR_NO_PRINTING_STDERR", "1");
        command
    }

    /// What `DISPLAY` is to be for a window of a client's own; of [`Compositor::Window`].
    #[must_use]
    pub fn display(&self) -> Option<String> {
        self.display.as_ref().map(Display::name)
    }

    /// The file that is the screen, in the format of X's window dumps; of [`Compositor::Window`].
    #[must_use]
    pub fn screen(&self) -> Option<PathBuf> {
        self.display.as_ref().map(Display::screen)
    }

    /// Where the service's socket is.
    #[must_use]
    pub fn runtime_directory(&self) -> PathBuf {
        self.place.path().join("run")
    }

    /// The scripted head; of a service that runs with [`Driver::Remote`].
    ///
    /// # Panics
    /// If the service has none, or does not answer.
    #[must_use]
    pub fn head(&self) -> Head {
        assert_eq!(self.driver, Driver::Remote, "a head that can be moved");
        Head::connect(self.port)
    }

    /// Whether the service runs.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.service.as_ref().is_some_and(Service::is_running)
    }

    /// The processes of the service and of its display.
    #[must_use]
    pub fn processes(&self) -> Vec<u32> {
        let display = self.display.as_ref().map(Display::service);
        let all = self.service.iter().chain(display);
        all.map(Service::id).collect()
    }

    /// The service's output so far.
    #[must_use]
    pub fn log(&self) -> String {
        std::fs::read_to_string(self.log_file()).unwrap_or_default()
    }

    fn log_file(&self) -> PathBuf {
        self.place.path().join("service.log")
    }

    /// Ends the service as a crash would.
    pub fn kill(&mut self) {
        self.service = None;
    }

    /// Stops the service, as SIGSTOP does.
    pub fn pause(&self) {
        self.signal(Signal::STOP);
    }

    /// Continues a stopped service.
    pub fn go_on(&self) {
        self.signal(Signal::CONT);
    }

    fn signal(&self, signal: Signal) {
        self.service.as_ref().expect("a service").signal(signal);
    }
}

/// Where Monado is; the reason where it is not.
fn prefix() -> Result<PathBuf, String> {
    let folder = std::env::var_os("MON3TR_MONADO").filter(|folder| !folder.is_empty());
    let folder = PathBuf::from(folder.ok_or("MON3TR_MONADO does not name a Monado's folder")?);
    for part in ["run", "openxr_monado.json", "libopenxr_loader.so.1"] {
        if !folder.join(part).exists() {
            return Err(format!("no {part} in {}", folder.display()));
        }
    }
    Ok(folder)
}

fn or_skip<T>(found: Result<T, String>) -> Option<T> {
    found
        .map_err(|why| {
            assert!(
                std::env::var("CI").as_deref() != Ok("true"),
                "no Monado: {why}"
            );
            println!("skipped: no Monado: {why}");
        })
        .ok()
}

/// A folder whose name leaves room for a socket's: 107 bytes in all.
fn short_folder() -> TempDir {
    let short = |place: &Path| place.as_os_str().len() < 60;
    let usual = std::env::temp_dir();
    let base = if short(&usual) {
        usual.as_path()
    } else {
        Path::new("/tmp")
    };
    tempfile::Builder::new()
        .prefix("xr")
        .tempdir_in(base)
        .unwrap_or_else(|why| panic!("a folder in {}: {why}", base.display()))
}

/// A folder for its owner alone, as a runtime directory has to be.
fn make_private(folder: &Path) {
    use std::os::unix::fs::DirBuilderExt;
    let mut builder = std::fs::DirBuilder::new();
    builder.mode(0o700);
    builder
        .create(folder)
        .unwrap_or_else(|why| panic!("{}: {why}", folder.display()));
}

fn free_port() -> u16 {
    let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a free port");
    listener.local_addr().expect("its address").port()
}
