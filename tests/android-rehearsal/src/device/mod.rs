//! The rehearsal as a device that adb sees: a program that talks to a headset by `adb` (`android/profile.sh`, `android/prove.sh`) is started with
//! an `adb` in its `PATH` that asks this process instead. It knows what those programs ask, and says so of anything else.

mod shell;

use crate::environment::Scene;
use crate::process::{LAUNCH, Process};
use android_rehearsal::adb::{Answer, Question, SOCKET};
use android_rehearsal::protocol::{ActivityIndex, Callback, Census};
use anyhow::{Context, ensure};
use shell::Word;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::symlink;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};
use std::time::Duration;
use synthetic_person::{Puppet, PuppetSize};
use test_support::speech::talk;

/// Its serial number.
const SERIAL: &str = "rehearsal";
/// The program that is `adb`, beside the driver.
const ADB: &str = "rehearsal-adb";
/// Variables for `android/prove.sh`, and the programs that they name: where one was not built, it says what it does not try.
const OURS: [(&str, &str); 2] = [
    ("MON3TR_PROGRAM", "mon3tr"),
    ("MON3TR_DEV_PROGRAM", "mon3tr-dev"),
];
/// How often to look whether the command has ended.
const LOOK: Duration = Duration::from_millis(10);

/// Executes a command that sees this device and no other.
pub(crate) fn execute(scene: Scene<'_>, command: &mut Command) -> anyhow::Result<ExitStatus> {
    let programs = scene.folder.join("programs");
    fs::create_dir_all(&programs)?;
    fs::create_dir_all(scene.external())?;
    let adb = scene
        .program(ADB)
        .with_context(|| format!("{ADB} is not built"))?;
    symlink(adb, programs.join("adb"))?;
    let avatar = scene.folder.join("person.m3a");
    Puppet::new(PuppetSize::FULL).avatar().save(&avatar)?;
    // A socket's path is short: the scene's own folder may be deep.
    let place = tempfile::tempdir()?;
    let socket = place.path().join("adb");
    let listener = UnixListener::bind(&socket)?;
    listener.set_nonblocking(true)?;
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::iter::once(programs).chain(std::env::split_paths(&path));
    for (variable, program) in OURS {
        if let Some(program) = scene.program(program) {
            command.env(variable, program);
        }
    }
    let mut child = command
        .env("MON3TR_PROVE_AVATAR", avatar)
        .env(SOCKET, &socket)
        .env("PATH", std::env::join_paths(path)?)
        .spawn()
        .with_context(|| format!("cannot start {command:?}"))?;
    let said: Vec<u8> = talk().into_iter().flat_map(f32::to_le_bytes).collect();
    let microphone = scene.folder.join("said.f32");
    fs::write(&microphone, said)?;
    let mut device = Device {
        microphone: microphone.display().to_string(),
        scene,
        running: None,
        log_from: 0,
    };
    loop {
        match listener.accept() {
            Ok((stream, _)) => device.serve(stream)?,
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                if let Some(status) = child.try_wait()? {
                    return Ok(status);
                }
                std::thread::sleep(LOOK);
            }
            Err(error) => return Err(error.into()),
        }
    }
}

struct Device<'a> {
    scene: Scene<'a>,
    /// What the wearer says.
    microphone: String,
    running: Option<Running>,
    /// What `logcat -c` has cleared, bytes.
    log_from: usize,
}

/// The app's process, and its activity.
struct Running {
    process: Process,
    activity: ActivityIndex,
}

impl Device<'_> {
    fn serve(&mut self, stream: UnixStream) -> anyhow::Result<()> {
        stream.set_nonblocking(false)?;
        let mut line = String::new();
        BufReader::new(&stream).read_line(&mut line)?;
        // Whoever asked may have been stopped meanwhile, before and after.
        let Ok(question) = serde_json::from_str::<Question>(&line) else {
            return Ok(());
        };
        let answer = match self.adb(&question) {
            Ok(said) => Answer { status: 0, said },
            Err(error) => Answer {
                status: 1,
                said: format!("error: {error:#}\n"),
            },
        };
        let _ = writeln!(&stream, "{}", serde_json::to_string(&answer)?);
        Ok(())
    }

    fn adb(&mut self, question: &Question) -> anyhow::Result<String> {
        let words: Vec<&str> = question.arguments.iter().map(String::as_str).collect();
        let words = match words.as_slice() {
            ["-s", serial, rest @ ..] => {
                ensure!(*serial == SERIAL, "device '{serial}' not found");
                rest
            }
            all => all,
        };
        match words {
            ["start-server"] => Ok(String::new()),
            ["devices"] => Ok(format!("List of devices attached\n{SERIAL}\tdevice\n\n")),
            // What is executed is this machine's own build.
            ["install", ..] => Ok("Performing Streamed Install\nSuccess\n".to_owned()),
            ["logcat", "-G", _] => Ok(String::new()),
            ["logcat", "-c"] => {
                self.log_from = self.log().len();
                Ok(String::new())
            }
            ["logcat", "-d", ..] => {
                let log = self.log();
                let log = log.get(self.log_from..).unwrap_or_default();
                Ok(String::from_utf8_lossy(log).into_owned())
            }
            ["push", from, to] => self.copy(&question.folder.join(from), &self.file(to)?),
            ["pull", from, to] => self.copy(&self.file(from)?, &question.folder.join(to)),
            ["shell", command @ ..] => self.shell(&command.join(" ")),
            other => anyhow::bail!("the rehearsal knows no adb {}", other.join(" ")),
        }
    }

    fn log(&self) -> Vec<u8> {
        fs::read(self.scene.folder.join("logcat")).unwrap_or_default()
    }

    fn copy(&self, from: &Path, to: &Path) -> anyhow::Result<String> {
        fs::copy(from, to).with_context(|| format!("cannot copy {}", from.display()))?;
        Ok(String::new())
    }

    /// The file here that a path on the device is.
    fn file(&self, path: &str) -> anyhow::Result<PathBuf> {
        let parts = path.split_once("/Android/data/").map(|(_, rest)| rest);
        let own = parts.and_then(|rest| Some(rest.split_once("/files")?.1));
        let own = own.with_context(|| format!("{path} is not in the app's folder"))?;
        ensure!(!own.contains(".."), "{path} leaves the app's folder");
        Ok(self.scene.external().join(own.trim_start_matches('/')))
    }

    /// Several commands of Android's shell; the last one's answer counts.
    fn shell(&mut self, line: &str) -> anyhow::Result<String> {
        let mut said = String::new();
        for command in shell::commands(line)? {
            said = self.command(&command)?;
        }
        Ok(said)
    }

    fn command(&mut self, words: &[Word]) -> anyhow::Result<String> {
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        match words.as_slice() {
            ["pm", "path", _] => Ok("package:/data/app/base.apk\n".to_owned()),
            ["pm", "grant", ..] | ["am", "broadcast", ..] => Ok(String::new()),
            ["am", "force-stop", _] => {
                self.running = None;
                Ok(String::new())
            }
            ["am", "start", options @ ..] => self.start(options),
            ["input", "keyevent", "KEYCODE_SLEEP"] => {
                self.calls(&[Callback::Pause, Callback::Stop])
            }
            ["input", "keyevent", "KEYCODE_WAKEUP"] => {
                self.calls(&[Callback::Start, Callback::Resume])
            }
            ["pidof", _] => Ok(self
                .census()?
                .map_or_else(String::new, |_| "4242\n".to_owned())),
            ["dumpsys", "meminfo", _] => Ok(self.census()?.map_or_else(
                || "No process found\n".to_owned(),
                |census| format!("           TOTAL PSS: {:>8}\n", census.resident / 1024),
            )),
            ["dumpsys", service] => Ok(format!("Can't find service: {service}\n")),
            ["getprop", "ro.product.model"] => Ok("Rehearsal\n".to_owned()),
            ["getprop", "ro.build.version.sdk"] => Ok("26\n".to_owned()),
            ["getprop", _] => Ok("\n".to_owned()),
            ["ip", "route"] => Ok("127.0.0.0/8 dev wlan0 scope link src 127.0.0.1\n".to_owned()),
            ["cat", path] => Ok(fs::read_to_string(self.file(path)?)?),
            ["rm", "-f", path] => {
                let _ = fs::remove_file(self.file(path)?);
                Ok(String::new())
            }
            ["mkdir", "-p", path] => {
                fs::create_dir_all(self.file(path)?)?;
                Ok(String::new())
            }
            [command, ..] => anyhow::bail!("the rehearsal knows no {command} like this"),
            [] => Ok(String::new()),
        }
    }

    fn start(&mut self, options: &[&str]) -> anyhow::Result<String> {
        let start = shell::start(options)?;
        if start.stops_first {
            self.running = None;
        }
        if self.census()?.is_some() {
            return Ok(
                "Warning: Activity not started, its current task has been brought to the front\n"
                    .to_owned(),
            );
        }
        let mut process = self.scene.process_with(&[
            ("REHEARSAL_WEARER", "allows"),
            ("REHEARSAL_MICROPHONE", &self.microphone),
        ])?;
        let activity = process.create(start.intent)?;
        process.calls(activity, &LAUNCH)?;
        self.running = Some(Running { process, activity });
        Ok("Starting: Intent { }\n".to_owned())
    }

    fn calls(&mut self, callbacks: &[Callback]) -> anyhow::Result<String> {
        if let Some(running) = &mut self.running {
            running.process.calls(running.activity, callbacks)?;
        }
        Ok(String::new())
    }

    /// Of the app's process; nothing where none runs.
    fn census(&mut self) -> anyhow::Result<Option<Census>> {
        let Some(running) = &mut self.running else {
            return Ok(None);
        };
        if running.process.ends_itself(Duration::ZERO)?.is_some() {
            self.running = None;
            return Ok(None);
        }
        running.process.census().map(Some)
    }
}
