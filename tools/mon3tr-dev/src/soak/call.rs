//! The call that is looked at: server, sender and receiver, each a process, a network that loses packets, and a headset's runtime.

use super::judgement::Outcome;
use super::person::Person;
use super::sample::{Sample, Shown};
use crate::usage::{Usage, has_loaded, load};
use anyhow::{Context, anyhow, ensure};
use link_http::Client;
use mon3tr::children::{LocalServer, Output, Process};
use mon3tr::monado::Monado;
use mon3tr::network::Network;
use netlab::{Impairment, Lab, LabConfig, Loss, Probability};
use serde_json::Value;
use std::ffi::OsString;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Each way.
const DELAY: Duration = Duration::from_millis(20);

/// An eye's picture: small, for a device that is none.
const EYE: &str = "480x360";

/// Vulkan's validation layer, as loaders and this machine's files name it.
const LAYER: (&str, &str) = ("VK_LAYER_KHRONOS_validation", "VkLayer_khronos_validation");

/// What each message of the layer begins with.
const MESSAGES: [&str; 3] = [
    "Validation Error:",
    "Validation Warning:",
    "Validation Performance Warning:",
];

/// A call in progress.
pub(super) struct Call<'a> {
    network: &'a Network,
    receiver: Process,
    sender: Process,
    lab: Lab,
    monado: Monado,
    server: LocalServer,
    /// Whether the headset's runtime is there.
    runtime: bool,
    report: PathBuf,
    /// What the receiver writes: its samples, and what it says.
    samples: Tail,
    said: Tail,
    shown: Option<Shown>,
    messages: u64,
}

impl<'a> Call<'a> {
    /// Begins it. What is to be looked at afterwards is in `out`, what is not in `folder`.
    ///
    /// # Errors
    /// If something of it does not start.
    pub(super) fn begin(
        network: &'a Network,
        person: &Person,
        loss: f64,
        folder: &Path,
        out: &Path,
    ) -> anyhow::Result<Self> {
        let monado = Monado::start()?;
        let server = LocalServer::start(folder)?;
        let client = Client::new(None)?;
        let (sender_link, viewer_link) = network.block_on(server.open_room(&client))?;
        let both = Impairment {
            delay: DELAY,
            loss: Loss::Independent(Probability::new(loss)?),
            ..Impairment::default()
        };
        let lab = network.block_on(Lab::start(LabConfig {
            down: both.clone(),
            up: both,
            ..LabConfig::new(server.address()?)
        }))?;
        let through_lab = viewer_link.at(format!("http://{}", lab.address()).parse()?);
        let file = |name: &str| out.join(name);
        let mut sending: Vec<OsString> = ["--room".into(), sender_link.to_string().into()].to_vec();
        for (option, path) in [
            ("--avatar", &person.avatar),
            ("--motion", &person.motion),
            ("--voice", &person.voice),
            ("--json", &file("sent.json")),
        ] {
            sending.extend([option.into(), path.into()]);
        }
        let sender = Process::start_sender(sending, &server.owner_token)?;
        let (report, samples, said) = (
            file("received.json"),
            file("shown.jsonl"),
            file("receive.log"),
        );
        let receiving: Vec<OsString> = [
            through_lab.to_string().into(),
            "--display".into(),
            "xr".into(),
            "--size".into(),
            EYE.into(),
            // So that it is played.
            "--sound".into(),
            unkept(folder)?.into(),
            "--samples".into(),
            samples.clone().into(),
            "--json".into(),
            report.clone().into(),
            "-v".into(),
        ]
        .to_vec();
        let mut environment = monado.environment();
        environment.push(("VK_INSTANCE_LAYERS", LAYER.0.into()));
        let log =
            File::create(&said).with_context(|| format!("cannot write {}", said.display()))?;
        let receiver = Process::start_in(environment, "receive", receiving, Output::Kept(log))?;
        Ok(Self {
            network,
            receiver,
            sender,
            lab,
            monado,
            server,
            runtime: true,
            report,
            samples: Tail::of(samples),
            said: Tail::of(said),
            shown: None,
            messages: 0,
        })
    }

    /// Whether people were shown since this was asked last.
    ///
    /// # Errors
    /// If a process has failed, or the receiver has no validation layer.
    pub(super) fn is_live(&mut self) -> anyhow::Result<bool> {
        self.read()?;
        let is_live = self.shown.take().is_some_and(|shown| shown.pictures > 0);
        if is_live {
            ensure!(
                has_loaded(self.receiver.id(), LAYER.1)?,
                "the receiver has not loaded {}: start through ./run, which fetches it, or install it (Debian, Ubuntu: `apt install \
                 vulkan-validationlayers`)",
                LAYER.0
            );
        }
        Ok(is_live)
    }

    /// Looks at it, so long after it was live.
    ///
    /// # Errors
    /// If a process has failed.
    pub(super) fn look(&mut self, since: Duration) -> anyhow::Result<Sample> {
        self.read()?;
        let processes = [self.server.id(), self.sender.id(), self.receiver.id()];
        let [serve, send, receive] = processes.map(Usage::of);
        Ok(Sample {
            seconds: since.as_secs_f64(),
            processes: [serve?, send?, receive?],
            shown: self.shown.take(),
            validation_messages: self.messages,
            runtime: self.runtime,
            load: load(),
        })
    }

    /// Takes the headset's runtime away, as a crash does.
    pub(super) fn kill_runtime(&mut self) {
        self.monado.kill();
        self.runtime = false;
    }

    /// Brings it back.
    ///
    /// # Errors
    /// If it does not start.
    pub(super) fn restart_runtime(&mut self) -> anyhow::Result<()> {
        self.monado.restart()?;
        self.runtime = true;
        Ok(())
    }

    /// Ends it.
    ///
    /// # Errors
    /// If the receiver leaves no report.
    pub(super) fn end(self) -> anyhow::Result<Outcome> {
        self.receiver.stop()?;
        self.sender.stop()?;
        self.network.block_on(self.lab.stop());
        self.server.stop()?;
        let report = std::fs::read(&self.report)
            .with_context(|| format!("cannot read {}", self.report.display()))?;
        let report: Value = serde_json::from_slice(&report)
            .with_context(|| format!("cannot read {}", self.report.display()))?;
        let count = |at: &str| {
            let count = report.pointer(at).and_then(Value::as_u64);
            count.ok_or_else(|| anyhow!("there is no figure {at} in {}", self.report.display()))
        };
        Ok(Outcome {
            opened: count("/headset/opened")?,
            connections: count("/call/received/sessions")?,
        })
    }

    /// What the receiver has written since.
    fn read(&mut self) -> anyhow::Result<()> {
        self.server.check()?;
        self.sender.check()?;
        self.receiver.check()?;
        if let Some(line) = self.samples.lines()?.last() {
            let shown = serde_json::from_str(line);
            self.shown = Some(shown.context("a line of the receiver's samples is none")?);
        }
        let messages = (self.said.lines()?.into_iter())
            .filter(|line| MESSAGES.iter().any(|message| line.contains(message)));
        self.messages += messages.count() as u64;
        Ok(())
    }
}

/// A sound file that keeps nothing: an hour of it would take 700 MB.
fn unkept(folder: &Path) -> anyhow::Result<PathBuf> {
    let file = folder.join("heard.wav");
    #[cfg(unix)]
    std::os::unix::fs::symlink("/dev/null", &file)
        .with_context(|| format!("cannot make {}", file.display()))?;
    Ok(file)
}

/// A file that another process appends lines to.
struct Tail {
    path: PathBuf,
    read: u64,
}

impl Tail {
    fn of(path: PathBuf) -> Self {
        Self { path, read: 0 }
    }

    /// The whole lines that have come since this was asked last; none while there is no file.
    fn lines(&mut self) -> anyhow::Result<Vec<String>> {
        let cannot = || format!("cannot read {}", self.path.display());
        let mut file = match File::open(&self.path) {
            Ok(file) => file,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(error).with_context(cannot),
        };
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(self.read)).with_context(cannot)?;
        file.read_to_end(&mut bytes).with_context(cannot)?;
        let whole = bytes.iter().rposition(|byte| *byte == b'\n');
        bytes.truncate(whole.map_or(0, |end| end + 1));
        self.read += bytes.len() as u64;
        let text = String::from_utf8_lossy(&bytes);
        Ok(text.lines().map(str::to_owned).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn lines_are_read_once_and_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("lines");
        let mut tail = Tail::of(path.clone());
        let none: [&str; 0] = [];
        assert_eq!(tail.lines().expect("no file is no error"), none, "no file");
        let mut file = File::create(&path).expect("a file");
        let mut write = |text: &str| file.write_all(text.as_bytes()).expect("it is written");
        write("one\ntw");
        assert_eq!(
            tail.lines().expect("a file"),
            ["one"],
            "half a line is none"
        );
        write("o\nthree\n");
        assert_eq!(tail.lines().expect("a file"), ["two", "three"], "its rest");
        assert_eq!(tail.lines().expect("a file"), none, "nothing new");
    }
}
