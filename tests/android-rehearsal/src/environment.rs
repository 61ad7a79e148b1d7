//! The environment of all cases, and the setup of each one.

use crate::process::Process;
use android_native::native::Built;
use android_rehearsal::protocol::Intent;
use anyhow::{Context, ensure};
use std::ffi::OsString;
use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use synthetic_person::{Puppet, PuppetSize};
use test_support::monado::{Compositor, Driver, Monado};
use test_support::program::{Program, through_runner};

/// Names the folder of Android's own ONNX Runtime for this machine's processor; set by `./run`.
const PARTS: &str = "MON3TR_ANDROID_PARTS_REHEARSAL";

/// Variables of a desktop's session.
const DESKTOP: [&str; 5] = [
    "HOME",
    "TMPDIR",
    "DISPLAY",
    "WAYLAND_DISPLAY",
    "RUST_BACKTRACE",
];

/// What was built and fetched: the same for all cases.
#[derive(Debug)]
pub(crate) struct Environment {
    /// The app's library.
    pub(crate) app: Built,
    shims: PathBuf,
    host: PathBuf,
    mon3tr: PathBuf,
    /// The folder of this and the other programs that were built.
    programs: PathBuf,
    /// What `nativeLibraryDir` is on a headset.
    libraries: PathBuf,
    /// Where logs and pictures are left.
    pub(crate) left: PathBuf,
}

impl Environment {
    pub(crate) fn new(repo: &Path, app: Built, shims: PathBuf) -> anyhow::Result<Self> {
        let libraries = std::env::var_os(PARTS).with_context(|| {
            format!("{PARTS} names no folder with ONNX Runtime for Android: ./run rehearse-android sets it")
        })?;
        // Both lie beside this program.
        let own: PathBuf = std::env::args_os().next().unwrap_or_default().into();
        let beside = own.parent().context("this program has no folder")?;
        let program = |name: &str| -> anyhow::Result<PathBuf> {
            let path = beside.join(name);
            ensure!(path.is_file(), "{} is not built", path.display());
            Ok(path)
        };
        Ok(Self {
            app,
            shims,
            host: program("android-host")?,
            mon3tr: program("mon3tr")?,
            programs: beside.to_path_buf(),
            libraries: libraries.into(),
            left: repo.join("target/android-rehearsal"),
        })
    }

    /// The setup of the case `name`: its folder, and a headset.
    pub(crate) fn scene(&self, name: &str, compositor: Compositor) -> anyhow::Result<Scene<'_>> {
        self.scene_of(name, Driver::Simulated, compositor)
    }

    /// The same with a headset of another kind.
    pub(crate) fn scene_of(
        &self,
        name: &str,
        driver: Driver,
        compositor: Compositor,
    ) -> anyhow::Result<Scene<'_>> {
        let folder = self.left.join(name);
        // A case leaves the files of its own run, and none of an earlier one.
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let monado = Monado::start(driver, compositor)
            .context("there is no Monado (MON3TR_MONADO): ./run rehearse-android fetches it")?;
        Ok(Scene {
            environment: self,
            folder,
            monado,
        })
    }
}

/// The setup of one case: a folder that stays, to be read, and a headset.
#[derive(Debug)]
pub(crate) struct Scene<'a> {
    environment: &'a Environment,
    pub(crate) folder: PathBuf,
    pub(crate) monado: Monado,
}

impl Scene<'_> {
    /// A process that has loaded the app as it is packaged: stripped.
    pub(crate) fn process(&self) -> anyhow::Result<Process> {
        self.process_with(&[])
    }

    /// The same with other variables besides.
    pub(crate) fn process_with(&self, variables: &[(&str, &str)]) -> anyhow::Result<Process> {
        let Environment {
            app,
            shims,
            host,
            libraries,
            ..
        } = self.environment;
        let mut command = self.monado.client(host);
        command
            .arg(&app.library)
            .arg(&self.folder)
            .arg(libraries)
            .env("LD_LIBRARY_PATH", shims)
            .env("REHEARSAL_OPENXR", self.open_xr_loader())
            .envs(variables.iter().copied());
        // What an app on Android does not have.
        let of_ours = |name: &str| name.starts_with("MON3TR_") || name.starts_with("ORT_");
        for (name, _) in std::env::vars_os() {
            let text = name.to_string_lossy();
            if of_ours(&text) || DESKTOP.contains(&&*text) {
                command.env_remove(&name);
            }
        }
        Process::start(command, &self.folder)
    }

    /// One of the programs that were built, by its name; nothing if it was not.
    pub(crate) fn program(&self, name: &str) -> Option<PathBuf> {
        let program = self.environment.programs.join(name);
        program.is_file().then_some(program)
    }

    fn open_xr_loader(&self) -> OsString {
        let folder = std::env::var_os("MON3TR_MONADO").unwrap_or_default();
        PathBuf::from(folder).join("libopenxr_loader.so.1").into()
    }

    /// The app's folder that adb can reach.
    pub(crate) fn external(&self) -> PathBuf {
        self.folder.join("external")
    }

    /// The app's file of the servers and calls that the wearer has agreed to.
    pub(crate) fn known_servers(&self) -> PathBuf {
        self.folder.join("internal/servers")
    }

    /// The wearer has been in the call of this link.
    pub(crate) fn knows_call(&self, link: &str) -> anyhow::Result<()> {
        let known = self.known_servers();
        fs::create_dir_all(known.parent().unwrap_or(&self.folder))?;
        let (call, _) = link.split_once('#').context("no link of a call")?;
        Ok(fs::write(known, format!("{call}\n"))?)
    }

    /// A server, and a person of this size to be sent.
    pub(crate) fn server(&self, person: PuppetSize) -> anyhow::Result<Server> {
        let folder = self.folder.join("server");
        let avatar = self.folder.join("person.m3a");
        Puppet::new(person).avatar().save(&avatar)?;
        let mut program = Program::start(
            mon3tr(self.environment, &self.folder)
                .args(["serve", "--listen", "127.0.0.1:0", "--data"])
                .arg(&folder),
        );
        let address = program.word_after("serving on http://");
        let token = fs::read_to_string(folder.join("owner-token"))
            .context("the server has left no token")?;
        // The wearer has been there; the case `consent` has one who was not.
        let known = self.known_servers();
        fs::create_dir_all(known.parent().unwrap_or(&self.folder))?;
        fs::write(known, format!("http://{address}\n"))?;
        Ok(Server {
            address: address.parse()?,
            avatar,
            token: token.trim().to_owned(),
            _program: program,
        })
    }

    /// A sender in a room that it opens.
    pub(crate) fn sender(&self, server: &Server) -> Sender {
        let address = format!("http://{}", server.address);
        let mut program = self.send(server, &["--server", &address]);
        Sender {
            viewers: program.word_after("mon3tr receive "),
            own: program.word_after("comes back with --room "),
            program,
        }
    }

    /// `mon3tr send` with these arguments.
    pub(crate) fn send(&self, server: &Server, arguments: &[&str]) -> Program {
        Program::start(
            mon3tr(self.environment, &self.folder)
                .args(["send", "--owner-token", &server.token, "--avatar"])
                .arg(&server.avatar)
                .args(arguments),
        )
    }
}

impl Scene<'_> {
    /// A person with the server's avatar, who opens a call of several there.
    pub(crate) fn call(&self, server: &Server, options: &[(&str, &str)]) -> Program {
        Program::start(
            mon3tr(self.environment, &self.folder)
                .args(["call", "--owner-token", &server.token, "--avatar"])
                .arg(&server.avatar)
                .args(options.iter().flat_map(|(name, value)| [name, value])),
        )
    }
}

/// The command `mon3tr`, as it is started here.
fn mon3tr(environment: &Environment, cache: &Path) -> Command {
    let mut command = through_runner(&environment.mon3tr);
    command
        .env("MON3TR_CACHE", cache)
        .env("RUST_LOG", "link=info")
        .env_remove("MON3TR_OWNER_TOKEN")
        .stdin(Stdio::null());
    command
}

/// A server that runs.
#[derive(Debug)]
pub(crate) struct Server {
    pub(crate) address: SocketAddr,
    /// The package of the person to be sent.
    pub(crate) avatar: PathBuf,
    token: String,
    _program: Program,
}

/// A sender that runs, and its room.
#[derive(Debug)]
pub(crate) struct Sender {
    pub(crate) program: Program,
    /// The link that viewers join with.
    pub(crate) viewers: String,
    /// The link that it comes back with.
    pub(crate) own: String,
}

/// The intent by which a link is opened on a headset.
pub(crate) fn opening(link: &str) -> Intent {
    Intent::view(&format!("mon3tr://room/{}", link.replacen("://", "/", 1))).with("log", "debug")
}

/// The intent by which a call's link is opened on a headset.
pub(crate) fn opening_call(link: &str) -> Intent {
    Intent::view(&format!("mon3tr://call/{}", link.replacen("://", "/", 1))).with("log", "debug")
}
