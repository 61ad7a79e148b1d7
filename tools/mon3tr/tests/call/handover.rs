//! A sender with more viewers than it serves itself: the server takes the others, and hands on what it cannot read.

use crate::audience::{assert_alike, frames};
use crate::command::mon3tr;
use crate::house::{House, Program, count};
use crate::interop::{program, python, said};
use crate::voice::write_wav;
use link_call::{Authentication, CallError, CallEvent, Viewer};
use link_codec::Codec;
use link_http::Client;
use link_playout::Clock;
use link_protocol::announcement::{AvatarRef, ChannelMode};
use link_protocol::presence::PresenceEvent;
use link_protocol::room_link::ServerUrl;
use link_protocol::{Announcement, LinkSecret, Refusal, RoomLink};
use link_voice::VoiceQueue;
use spmm3::Avatar;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use test_support::service::{self, LONGEST_WAIT, Service, listener};
use test_support::speech::syllables;

/// What a sender serves itself.
pub(crate) const DIRECT: usize = 8;

pub(crate) struct Hall<'a> {
    house: &'a House,
    pub(crate) client: Client,
    clock: Clock,
    pub(crate) authentication: Authentication,
}

impl<'a> Hall<'a> {
    pub(crate) fn of(house: &'a House) -> Self {
        let signer = Avatar::load(&house.avatar).expect("the package").signer;
        Self {
            house,
            client: Client::new(None).expect("a client"),
            clock: Clock::start(),
            authentication: Authentication { own: None, signer },
        }
    }

    fn join(&self, link: &RoomLink) -> Viewer {
        self.join_as(link, self.authentication.clone())
    }

    pub(crate) fn join_as(&self, link: &RoomLink, authentication: Authentication) -> Viewer {
        let _network = self.house.runtime.enter();
        let voice = VoiceQueue::default();
        let (client, link) = (self.client.clone(), link.clone());
        Viewer::join(client, link, authentication, self.clock, voice)
    }

    /// So many, one after the other.
    pub(crate) fn fill(&self, link: &RoomLink, many: usize) -> Vec<Viewer> {
        let viewers = (0..many).map(|_| {
            let viewer = self.join(link);
            let until = Instant::now() + LONGEST_WAIT;
            while viewer.statistics().sessions == 0 {
                assert!(Instant::now() < until, "one does not get in");
                std::thread::sleep(Duration::from_millis(10));
            }
            viewer
        });
        viewers.collect()
    }
}

/// Waits for the end of a viewer's call.
pub(crate) fn ends(viewer: &Viewer) -> CallEvent {
    let until = Instant::now() + LONGEST_WAIT;
    loop {
        assert!(Instant::now() < until, "it goes on");
        let event = viewer.next(Duration::from_millis(100));
        if let Ok(end @ (CallEvent::HungUp | CallEvent::Failed(_))) = event {
            return end;
        }
    }
}

/// An avatar that its owner has signed, who drives it with a voice; the link for viewers.
fn speaker(house: &House, codec: &str) -> (Program, RoomLink, String) {
    let avatar = house.avatar.to_str().expect("UTF-8");
    mon3tr(&["keys", "sign", avatar]).succeeds();
    let spoken = house.path("said.wav");
    write_wav(&spoken, link_voice::RATE, &syllables(1));
    let sender = house.sender(&["--voice", &spoken, "--codec", codec]);
    let link = sender.viewers.parse().expect("a link");
    (sender.program, link, sender.own)
}

/// The number of this line of the server's counters.
fn metric(house: &House, line: &str) -> Option<String> {
    let mut stream = TcpStream::connect(house.address).expect("the server is there");
    let ask = "GET /metrics HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n";
    stream.write_all(ask.as_bytes()).expect("asked");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("answered");
    let found = answer.lines().find_map(|l| l.strip_prefix(line));
    found.map(str::to_owned)
}

#[test]
fn the_ninth_viewer_is_handed_to_the_server_and_sees_and_hears_the_same() {
    let house = House::open_with(&["--forward"]);
    let (mut sender, link, own) = speaker(&house, "compact");
    let hall = Hall::of(&house);
    let mut viewers = hall.fill(&link, DIRECT);
    assert!(
        !house.said_by_server().contains("forwarding begins"),
        "eight"
    );
    viewers.extend(hall.fill(&link, 5));
    house.server_says("forwarding begins in room", 1);
    assert_alike(&frames(&viewers, 60));
    sender.says("5 watch through the server", 1);
    let forwarded_to = metric(&house, "mon3tr_viewers_forwarded_to ");
    assert_eq!(forwarded_to.as_deref(), Some("5"));
    let owner = hall.authentication.signer;
    for (number, viewer) in viewers.iter().enumerate() {
        let statistics = viewer.statistics();
        assert!(statistics.voice > 20, "{number}: {statistics:?}");
        assert_eq!(
            statistics.sender, owner,
            "{number}: they know whom they see"
        );
        assert!(
            statistics.clock_offset_us.is_some(),
            "{number}: {statistics:?}"
        );
        // Only what came before the seal was known.
        assert!(statistics.refused.total() < 10, "{number}: {statistics:?}");
    }
    // One of those whom the server serves leaves: the others go on by the key of another epoch.
    let one = viewers.pop().expect("a viewer");
    house.runtime.block_on(one.hang_up());
    for viewer in &viewers {
        while viewer.next(Duration::ZERO).is_ok() {}
    }
    assert_alike(&frames(&viewers, 90));
    for (number, viewer) in viewers.iter().enumerate() {
        let statistics = viewer.statistics();
        assert_eq!(statistics.sessions, 1, "{number}: {statistics:?}");
    }
    // Who has the token alone, as the server has, is neither taken by the sender nor handed over.
    let token = RoomLink::of(
        link.server().clone(),
        link.room().as_str(),
        link.token().secret(),
    );
    let stranger = hall.join(&token.expect("a link"));
    let end = ends(&stranger);
    assert!(
        matches!(end, CallEvent::Failed(CallError::Refused(Refusal::Link))),
        "{end:?}"
    );

    // The sender is killed and comes back: everybody finds it again, eight of them directly.
    sender.kill();
    let avatar = house.avatar.to_str().expect("UTF-8").to_owned();
    let again = house.send(&["--room", &own, "--avatar", &avatar]);
    for viewer in &viewers {
        while viewer.next(Duration::ZERO).is_ok() {}
    }
    assert_alike(&frames(&viewers, 60));
    let report = again.ends();
    let joined = count(&report, "joined");
    assert!(joined > DIRECT as u64, "{report:#}");
    assert!(count(&report, "viewers") <= DIRECT as u64 + 1, "{report:#}");
    for viewer in &viewers {
        assert!(
            matches!(ends(viewer), CallEvent::HungUp),
            "the sender's goodbye"
        );
    }
    house.server_says("forwarding has ended in room", 1);
}

/// The first one stays, with the viewers that it serves itself; whom the second hands over must not be shown the first.
#[test]
fn a_sender_that_takes_anothers_place_is_forwarded_in_its_place() {
    let house = House::open_with(&["--forward"]);
    let (mut first, link, own) = speaker(&house, "compact");
    let hall = Hall::of(&house);
    let viewers = hall.fill(&link, DIRECT + 1);
    house.server_says("forwarding begins in room", 1);
    let avatar = house.avatar.to_str().expect("UTF-8").to_owned();
    let mut second = house.send(&["--room", &own, "--avatar", &avatar]);
    first.says("another sender has entered the room", 1);
    second.says("the server's forwarder has joined", 1);
    let forwarded = &viewers[DIRECT..];
    for viewer in forwarded {
        while viewer.next(Duration::ZERO).is_ok() {}
    }
    assert!(frames(forwarded, 60)[0].len() >= 60, "it goes on");
    assert!(first.is_running(), "so does the first one");
    // The second one has no key in common with the viewer, which therefore offers again, to it.
    let statistics = forwarded[0].statistics();
    assert!(statistics.sessions > 1, "{statistics:?}");
    let sent = second.ends();
    assert!((1..=2).contains(&count(&sent, "viewers")), "{sent:#}");
    first.ends();
}

/// A sender of another program that refuses everyone: the server does not keep who it cannot serve.
#[test]
fn who_cannot_be_forwarded_to_is_told_that_there_are_too_many() {
    let house = House::open_with(&["--forward"]);
    let refuses = house.runtime.block_on(async {
        let client = Client::new(None).expect("a client");
        let server: ServerUrl = format!("http://{}", house.address).parse().expect("it");
        let token = house.owner_token();
        let put = client.put_package(&server, &token, &house.avatar, |_, _| {});
        put.await.expect("the package is taken");
        let room = client
            .open_room(&server, &token, None)
            .await
            .expect("a room");
        let announcement = Announcement {
            avatar: AvatarRef::of_file(&house.avatar).expect("the package"),
            channel: ChannelMode::default(),
            codec: Codec::default(),
            rate_hz: 30.0,
        };
        let presence = client
            .open_presence(&room.sender, &announcement.into())
            .await;
        let mut presence = presence.expect("in the room");
        let sender = room.sender.clone();
        tokio::spawn(async move {
            while let Ok(event) = presence.next().await {
                if let PresenceEvent::Offer { session, .. } = event {
                    let full = Refusal::Full.answer();
                    let _ = client.answer(&sender, &session, &full).await;
                }
            }
        });
        room.viewer.with_secret(LinkSecret::new([1; 16]))
    });
    let mut viewer = house.receiver(&refuses.to_string(), "viewer", &[]);
    viewer.says("the sender has as many viewers as it serves", 1);
    assert!(
        !viewer.said().contains("joined (session"),
        "{}",
        viewer.said()
    );
    viewer.ask_to_end();
    let said = viewer.fails();
    let why = "it never began: the sender has as many viewers as it serves";
    assert!(said.contains(why), "{said}");
}

#[test]
fn a_viewer_that_is_not_ours_opens_what_the_server_hands_on() {
    let Some(python) = python() else {
        return;
    };
    let house = House::open_with(&["--forward"]);
    let (_sender, link, _) = speaker(&house, "paper");
    let hall = Hall::of(&house);
    let _viewers = hall.fill(&link, DIRECT);
    let mut command = Command::new(python);
    command
        .arg(program("aiortc_viewer.py"))
        .arg(link.to_string())
        .args(["--frames", "60"]);
    let seen = said(&service::output("aiortc's viewer", &mut command));
    assert!(count(&seen["counts"], "opened") >= 60, "{seen:#}");
    assert_eq!(seen["sealed"], true, "{seen:#}");
}

/// What instances share: NATS and an S3-compatible store.
struct Shared {
    _nats: Service,
    _store: Service,
    options: [String; 6],
}

impl Shared {
    /// Nothing where the programs are not there.
    fn start(folder: &TempDir) -> Option<Self> {
        let python = python()?;
        let Some(nats) = std::env::var_os("MON3TR_NATS_SERVER") else {
            println!("skipped: MON3TR_NATS_SERVER does not say where nats-server is");
            assert_ne!(
                std::env::var("CI").as_deref(),
                Ok("true"),
                "CI must have it"
            );
            return None;
        };
        let port = || {
            let free = TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr());
            free.expect("a free port").port()
        };
        let log = |name: &str| folder.path().join(name);
        let (nats_port, store_port) = (port(), port());
        let mut command = Command::new(nats);
        command.args(["-a", "127.0.0.1", "-p", &nats_port.to_string()]);
        let nats = listener("nats-server", &mut command, nats_port, &log("nats.log"));
        let mut command = Command::new(python);
        command.args(["-m", "moto.server", "-H", "127.0.0.1", "-p"]);
        command.arg(store_port.to_string());
        let store = listener("moto", &mut command, store_port, &log("moto.log"));
        let endpoint = format!("http://127.0.0.1:{store_port}");
        make_bucket(store_port);
        let nats_address = format!("nats://127.0.0.1:{nats_port}");
        let options = [
            "--nats",
            &nats_address,
            "--s3",
            BUCKET,
            "--s3-endpoint",
            &endpoint,
        ];
        Some(Self {
            _nats: nats,
            _store: store,
            options: options.map(str::to_owned),
        })
    }
}

const BUCKET: &str = "avatars";

fn make_bucket(port: u16) {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("the store is there");
    let ask = format!(
        "PUT /{BUCKET} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
    );
    stream.write_all(ask.as_bytes()).expect("asked");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("answered");
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
}

/// Each instance forwards to those who came to it, and is one viewer of the sender's.
#[test]
fn instances_that_share_their_rooms_share_an_audience() {
    let folder = TempDir::new().expect("a temporary folder");
    let Some(shared) = Shared::start(&folder) else {
        return;
    };
    let options = shared.options.each_ref().map(String::as_str);
    let house = House::open_with(&[&["--forward"], options.as_slice()].concat());
    let mut other = house.another_server();
    let at = other.word_after("serving on ");
    let (sender, link, _) = speaker(&house, "compact");
    let elsewhere = link.at(at.parse().expect("an address"));
    let hall = Hall::of(&house);
    let mut viewers = hall.fill(&link, DIRECT);
    viewers.extend(hall.fill(&elsewhere, 3));
    viewers.extend(hall.fill(&link, 3));
    assert_alike(&frames(&viewers, 60));
    house.server_says("forwarding begins in room", 1);
    other.says("forwarding begins in room", 1);
    let report = sender.ends();
    assert_eq!(count(&report, "viewers"), DIRECT as u64 + 2, "{report:#}");
    for viewer in &viewers {
        assert!(
            matches!(ends(viewer), CallEvent::HungUp),
            "the sender's goodbye"
        );
    }
}
