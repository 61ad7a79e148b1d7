//! Relay and forwarder as processes of their own: what is left of a server when one of them is killed.

use crate::server::Server;
use crate::support::{command, text};
use link_call::{Authentication, Viewer};
use link_http::Client;
use link_playout::Clock;
use link_protocol::RoomLink;
use link_voice::VoiceQueue;
use std::path::Path;
use std::time::{Duration, Instant};
use test_support::program::Program;
use test_support::service::LONGEST_WAIT;

/// Viewers that a sender serves itself where its server forwards.
const DIRECT: usize = 8;

/// Viewers in this process.
struct Viewers {
    runtime: tokio::runtime::Runtime,
    there: Vec<Viewer>,
}

impl Viewers {
    fn none() -> Self {
        Self {
            runtime: tokio::runtime::Runtime::new().expect("a runtime"),
            there: Vec::new(),
        }
    }

    /// One more, who is awaited.
    fn join(&mut self, link: &RoomLink) {
        let entered = self.runtime.enter();
        let client = Client::new(None).expect("a client");
        let nobody = Authentication::default();
        let voice = VoiceQueue::default();
        let viewer = Viewer::join(client, link.clone(), nobody, Clock::start(), voice);
        drop(entered);
        self.there.push(viewer);
        self.wait("a viewer's frames", |all| {
            all.last()
                .is_some_and(|viewer| viewer.statistics().frames > 0)
        });
    }

    /// Takes what comes until this is so.
    fn wait(&self, what: &str, is_so: impl Fn(&[Viewer]) -> bool) {
        let until = Instant::now() + LONGEST_WAIT;
        while !is_so(&self.there) {
            assert!(Instant::now() < until, "waited in vain for {what}");
            for viewer in &self.there {
                while viewer.next(Duration::ZERO).is_ok() {}
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// That all of these have frames from now on.
    fn assert_live(&self, viewers: &[usize]) {
        let before: Vec<u64> = self.frames();
        self.wait("more frames", |all| {
            viewers
                .iter()
                .all(|k| all[*k].statistics().frames > before[*k] + 10)
        });
    }

    fn frames(&self) -> Vec<u64> {
        self.there
            .iter()
            .map(|one| one.statistics().frames)
            .collect()
    }

    fn sessions(&self, viewer: usize) -> u32 {
        self.there[viewer].statistics().sessions
    }
}

fn relay(secret: &Path, listen: &str) -> Program {
    let arguments = ["relay", "--listen", listen, "--secret", text(secret)];
    let mut program = Program::start(&mut command(&arguments));
    program.says("relaying calls", 1);
    program
}

fn forwarder(socket: &Path) -> Program {
    let mut program = Program::start(&mut command(&["forwarder", "--listen", text(socket)]));
    program.says("forwarding to at most", 1);
    program
}

/// A port that is free now.
fn free_port() -> String {
    let socket = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    socket.local_addr().expect("an address").port().to_string()
}

#[test]
fn a_call_and_newcomers_go_on_when_the_relays_process_is_killed() {
    let port = free_port();
    let mut server = Server::start(&["--turn-at", &port]);
    let secret = server.path("data/secret");
    let listen = format!("127.0.0.1:{port}");
    let running = relay(&secret, &listen);
    let line = server.canary(&[]).succeeds();
    assert!(line.contains("; relay 127.0.0.1 over UDP"), "{line}");

    let (_sender, link) = server.sender();
    let mut viewers = Viewers::none();
    viewers.join(&link);
    drop(running);
    server.canary(&[]).fails_naming(&["fails: relay: "]);
    viewers.join(&link);
    viewers.assert_live(&[0, 1]);
    assert_eq!(viewers.sessions(0), 1, "the call was not interrupted");
    server.assert_runs();

    let _again = relay(&secret, &listen);
    server.canary(&[]).succeeds();
}

#[test]
fn direct_viewers_go_on_when_the_forwarders_process_is_killed_and_the_others_return_when_it_is_back()
 {
    let folder = tempfile::tempdir().expect("a folder");
    let socket = folder.path().join("forwarder.sock");
    let running = forwarder(&socket);
    let mut server = Server::start_in(folder, &["--forward-at", text(&socket)]);
    let line = server.canary(&[]).succeeds();
    assert!(line.contains("; forwarded after"), "{line}");

    let (_sender, link) = server.sender();
    let mut viewers = Viewers::none();
    for _ in 0..=DIRECT {
        viewers.join(&link);
    }
    // As `kill -9`.
    drop(running);
    server.canary(&[]).fails_naming(&["fails: forwarding: "]);
    viewers.assert_live(&[0, DIRECT - 1]);
    server.assert_runs();

    let _again = forwarder(&socket);
    viewers.assert_live(&[DIRECT]);
    assert!(viewers.sessions(DIRECT) > 1, "it has joined again");
    let direct = (0..DIRECT).map(|viewer| viewers.sessions(viewer));
    assert_eq!(
        direct.max(),
        Some(1),
        "the others' calls were not interrupted"
    );
    server.canary(&[]).succeeds();
}

#[test]
fn viewers_whom_another_process_forwards_to_go_on_when_the_signaling_is_killed() {
    let folder = tempfile::tempdir().expect("a folder");
    let socket = folder.path().join("forwarder.sock");
    let _forwarder = forwarder(&socket);
    let server = Server::start_in(folder, &["--forward-at", text(&socket)]);
    let (_sender, link) = server.sender();
    let mut viewers = Viewers::none();
    for _ in 0..=DIRECT {
        viewers.join(&link);
    }
    let _folder = server.kill();
    viewers.assert_live(&[0, DIRECT]);
    viewers.assert_live(&[0, DIRECT]);
    assert_eq!(viewers.sessions(DIRECT), 1, "it was not interrupted");
}

#[test]
fn a_second_forwarder_does_not_take_the_socket_of_the_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let socket = folder.path().join("forwarder.sock");
    let _first = forwarder(&socket);
    let second = crate::support::mon3tr(&["forwarder", "--listen", text(&socket)]);
    second.fails_naming(&["cannot listen on", "forwarder.sock"]);
}
