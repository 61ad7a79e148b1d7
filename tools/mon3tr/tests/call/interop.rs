//! Implementations that are not ours, written from `docs/protocol.md` alone: aiortc as a sender and as a viewer, and a browser as a viewer.

use crate::house::{House, count, number};
use link_http::Client;
use link_http::rooms::Room;
use link_protocol::announcement::AvatarRef;
use link_protocol::room_link::ServerUrl;
use serde_json::Value;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;
use test_support::service::{self, Service, attended};

/// Where the programs are.
pub(crate) fn program(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/interop")
        .join(name)
}

/// A Python with aiortc; on CI there must be one.
pub(crate) fn python() -> Option<String> {
    let python = std::env::var("MON3TR_PYTHON")
        .ok()
        .filter(|python| !python.is_empty());
    if python.is_none() {
        let why = "MON3TR_PYTHON names no Python with aiortc; ./run test fetches one";
        assert!(std::env::var("CI").as_deref() != Ok("true"), "{why}");
        println!("skipped: {why}");
    }
    python
}

/// aiortc as a sender. It ends with the test, if it has not ended before.
struct AiortcSender {
    service: Service,
    folder: TempDir,
}

impl AiortcSender {
    fn start(command: &mut Command) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let told = File::create(folder.path().join("told")).expect("a file");
        let log = folder.path().join("log");
        let command = command.stdin(Stdio::null());
        Self {
            service: Service::start("aiortc's sender", command, &log, Some(told)),
            folder,
        }
    }

    /// Asks it to end and returns what it said.
    fn ends(self) -> Value {
        let status = self.service.end();
        let [stdout, stderr] = ["told", "log"]
            .map(|name| std::fs::read(self.folder.path().join(name)).expect("the file"));
        said(&Output {
            status,
            stdout,
            stderr,
        })
    }
}

pub(crate) fn said(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}\n{errors}");
    let last = text.lines().last().unwrap_or_default();
    serde_json::from_str(last).unwrap_or_else(|error| panic!("{error} in {text}\n{errors}"))
}

#[test]
fn a_sender_that_is_not_ours_is_received() {
    let Some(python) = python() else {
        return;
    };
    attended(|| a_sender_is_received(&python));
}

fn a_sender_is_received(python: &str) {
    let house = House::open();
    let avatar = AvatarRef::of_file(&house.avatar).expect("the package");
    let room: Room = house.runtime.block_on(async {
        let client = Client::new(None).expect("a client");
        let server: ServerUrl = format!("http://{}", house.address)
            .parse()
            .expect("an address");
        let token = house.owner_token();
        let put = client.put_package(&server, &token, &house.avatar, |_, _| {});
        put.await.expect("the package is taken");
        let room = client.open_room(&server, &token, None);
        room.await.expect("a room")
    });
    for channel in ["unreliable", "reliable"] {
        let mut command = Command::new(python);
        command
            .arg(program("aiortc_sender.py"))
            .arg(room.sender.to_string())
            .args(["--sha256", &avatar.sha256.to_string()])
            .args(["--bytes", &avatar.bytes.to_string()])
            .args(["--channel", channel, "--address", "127.0.0.1"]);
        let sender = AiortcSender::start(&mut command);
        let mut receiver = house.receiver(&room.viewer.to_string(), "viewer", &[]);
        receiver.says("joined (session", 1);
        // Three seconds of a call, by what has come rather than by the clock.
        std::thread::sleep(std::time::Duration::from_secs(3));
        let sent = sender.ends();
        let seen = receiver.report();
        let call = &seen["call"];
        assert!(
            count(call, "released") > 30,
            "{channel}: {call:#}\n{sent:#}"
        );
        assert_eq!(call["announced"]["channel"], channel, "{call:#}");
        assert!(
            call["received"]["refused"]
                .as_object()
                .is_some_and(serde_json::Map::is_empty),
            "{channel}: {call:#}"
        );
        // Its clock counts from another day: only by comparing both can a plausible time come out.
        let network = number(&call["latency"]["network"], "p50_ms");
        assert!((0.0..1000.0).contains(&network), "{channel}: {call:#}");
    }
}

#[test]
fn a_viewer_that_is_not_ours_sees_our_motion() {
    let Some(python) = python() else {
        return;
    };
    let house = House::open();
    for channel in ["unreliable", "reliable"] {
        let sender = house.sender(&["--codec", "paper", "--channel", channel]);
        let mut command = Command::new(&python);
        command
            .arg(program("aiortc_viewer.py"))
            .arg(&sender.viewers)
            .args([
                "--frames",
                "60",
                "--keep",
                "1,30,60",
                "--address",
                "127.0.0.1",
            ]);
        let seen = said(&service::output("aiortc's viewer", &mut command));
        assert!(number(&seen, "frames") >= 60.0, "{channel}: {seen:#}");
    }
}

/// Optional: said, and not failed, where there is no Chromium, on CI too.
#[test]
fn a_browser_sees_our_motion() {
    let house = House::open();
    let sender = house.sender(&["--codec", "paper"]);
    let mut command = Command::new("python3");
    command
        .arg(program("chromium_viewer.py"))
        .arg(&sender.viewers);
    let seen = service::output("Chromium's Python", &mut command);
    let text = String::from_utf8_lossy(&seen.stdout);
    if text.starts_with("skipped: ") {
        println!("{text}");
        return;
    }
    for line in text
        .lines()
        .filter(|line| line.starts_with("started again: "))
    {
        println!("{line}");
    }
    let seen = said(&seen);
    assert!(number(&seen, "frames") >= 60.0, "{seen:#}");
}
