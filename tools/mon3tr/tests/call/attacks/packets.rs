//! Hosts without a link send DTLS, SCTP, STUN and RTP packets to the ports of a call, and holders of a link attack the
//! transport of the program at the other end.

use super::extent;
use crate::handover::{DIRECT, Hall};
use crate::house::{House, Program, count, wait_for};
use crate::interop::{program, python, said};
use link_call::Viewer;
use link_http::Client;
use link_protocol::RoomLink;
use link_protocol::announcement::AvatarRef;
use link_protocol::room_link::ServerUrl;
use serde_json::Value;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::process::Command;
use std::time::{Duration, Instant};
use test_support::service;

/// Where the host without a link sends from: it has no part in any call.
const STRANGER: Ipv4Addr = Ipv4Addr::new(127, 0, 0, 7);

/// How much more memory a program may have after an attack, bytes.
const GROWTH: u64 = 5 << 20;

/// A DTLS record of handshake, by its epoch and number.
fn record(epoch: u16, sequence: u64, body: &[u8]) -> Vec<u8> {
    let mut record = vec![22, 254, 253];
    record.extend(epoch.to_be_bytes());
    record.extend(&sequence.to_be_bytes()[2..]);
    record.extend(u16::try_from(body.len()).expect("short").to_be_bytes());
    record.extend(body);
    record
}

/// The header of a fragment.
fn head(message: u16, length: u32, offset: u32, part: u32) -> Vec<u8> {
    let [length, offset, part] = [length, offset, part].map(u32::to_be_bytes);
    let message = message.to_be_bytes();
    [&[1], &length[1..], &message, &offset[1..], &part[1..]].concat()
}

/// Records of 110 headers, each of which points to the next one. Their numbers grow from chain to chain: older ones
/// count as repeated.
fn chain(message: u16, epoch: u16, offsets: &[u32]) -> Vec<Vec<u8>> {
    let first = offsets.first().copied().unwrap_or_default();
    let base = 1 << 40 | u64::from(first) << 24 | u64::from(message) << 12;
    let record = |(offsets, sequence): (&[u32], u64)| {
        let heads: Vec<u8> = (offsets.iter().flat_map(|&at| head(message, 0, at, 1))).collect();
        record(epoch, sequence, &heads)
    };
    offsets.chunks(110).zip(base..).map(record).collect()
}

/// The first links last, as is needed to follow them: a message is looked for in all its fragments when its first one
/// is there.
const LINKS: u32 = 24_000;

/// Packets that a host without a link may send, with a name for each kind.
fn assaults() -> Vec<(&'static str, Vec<Vec<u8>>)> {
    let mut random = fastrand::Rng::with_seed(15);
    let forwards: Vec<u32> = (1..LINKS).chain([0]).collect();
    let backwards: Vec<u32> = (0..LINKS).rev().collect();
    // The other side's next message of the handshake is one of these.
    let messages = || 4..8u16;
    let next = |offsets: &[u32]| messages().flat_map(|m| chain(m, 0, offsets)).collect();
    let epochs = (1..4).flat_map(|epoch| chain(6, epoch, &forwards));
    let bytes = |length: usize, random: &mut fastrand::Rng| -> Vec<u8> {
        (0..length).map(|_| random.u8(..)).collect()
    };
    let overlapping = (0..8_000).map(|k| {
        let fragment = [head(6, LINKS, k, 3), vec![7; 3]].concat();
        record(0, (1 << 41) + u64::from(k), &fragment)
    });
    let empty = (0..2_000).map(|k| record(0, (1 << 42) + k, &head(9, 5, 0, 0).repeat(90)));
    let lying = (0..2_000u64).map(|k| {
        let mut lies = record(0, (1 << 43) + k, &head(6, 9, 0, 200));
        lies.extend(record(0, k, &[0; 40]));
        lies[11..13].copy_from_slice(&random.u16(..).to_be_bytes());
        lies
    });
    let lying = lying.collect();
    let rtp = (0..8_000u32).map(|k| {
        let kind = if k % 2 == 0 { 111 } else { 201 };
        let ssrc = random.u32(..).to_be_bytes();
        let rest = bytes(40, &mut random);
        [&[0x80, kind, 0, 1], &ssrc[..], &ssrc, &rest].concat()
    });
    let rtp = rtp.collect();
    let chained = chain(6, 0, &forwards);
    let relayed = chained.iter().map(|datagram| {
        let padded = datagram.len().next_multiple_of(4);
        let mut message = vec![0x00, 0x17];
        message.extend(u16::try_from(12 + 4 + padded).expect("short").to_be_bytes());
        message.extend([0x21, 0x12, 0xA4, 0x42]);
        message.extend([9; 12]);
        message.extend([0, 0x12, 0, 8, 0, 1, 0x21, 0x13, 0x5E, 0x12, 0xA4, 0x43]);
        message.extend([0, 0x13]);
        message.extend(u16::try_from(datagram.len()).expect("short").to_be_bytes());
        message.extend(datagram);
        message.resize(20 + 12 + 4 + padded, 0);
        message
    });
    let channels = chained.iter().map(|datagram| {
        let length = u16::try_from(datagram.len()).expect("short").to_be_bytes();
        [&[0x40, 0x00], &length[..], datagram].concat()
    });
    let relayed = relayed.chain(channels).collect();
    let junk = (0..8_000).map(|_| {
        let length = random.usize(1..200);
        bytes(length, &mut random)
    });
    vec![
        ("chains, the first link last", next(&forwards)),
        ("chains backwards", next(&backwards)),
        ("chains of other epochs", epochs.collect()),
        ("overlapping fragments", overlapping.collect()),
        ("empty fragments", empty.collect()),
        ("records that lie about their lengths", lying),
        ("RTP and RTCP of many sources", rtp),
        ("chains as a relay brings them", relayed),
        ("random bytes", junk.collect()),
    ]
}

/// The UDP ports of a process.
fn ports(process: &Program) -> Vec<SocketAddr> {
    let folder = format!("/proc/{}", process.id());
    let links = std::fs::read_dir(format!("{folder}/fd")).expect("it runs");
    let links = links.filter_map(|entry| std::fs::read_link(entry.ok()?.path()).ok());
    let sockets: Vec<String> = links
        .filter_map(|link| {
            let inode = link.to_str()?.strip_prefix("socket:[")?;
            Some(inode.strip_suffix(']')?.to_owned())
        })
        .collect();
    let table = std::fs::read_to_string(format!("{folder}/net/udp")).expect("it runs");
    let local = table.lines().skip(1).filter_map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let (address, inode) = (words.get(1)?, words.get(9)?);
        let (ip, port) = address.split_once(':')?;
        let ip = Ipv4Addr::from(u32::from_str_radix(ip, 16).ok()?.to_le_bytes());
        let port = u16::from_str_radix(port, 16).ok()?;
        sockets
            .iter()
            .any(|socket| socket == inode)
            .then_some(SocketAddr::from((ip, port)))
    });
    let local: Vec<SocketAddr> = local.collect();
    assert!(!local.is_empty(), "it has UDP ports:\n{table}");
    local
}

/// Sends every assault to every port of a process, whose memory may not grow by more than [`GROWTH`]; `goes_on` after
/// each.
fn withstands(process: &Program, mut goes_on: impl FnMut(&str)) {
    goes_on("before");
    let before = process.resident_memory();
    let socket = UdpSocket::bind((STRANGER, 0)).expect("a second address of the loopback");
    for _ in 0..extent(1, 10) {
        for (name, datagrams) in assaults() {
            let targets = ports(process);
            for (number, datagram) in datagrams.iter().enumerate() {
                for target in &targets {
                    // A full buffer loses it, as a network does.
                    let _ = socket.send_to(datagram, target);
                }
                if number % 20 == 0 {
                    std::thread::sleep(Duration::from_millis(10));
                }
            }
            goes_on(name);
            let grown = process.resident_memory().saturating_sub(before);
            println!(
                "{name}: {} datagrams, {} kB more",
                datagrams.len(),
                grown >> 10
            );
            assert!(grown <= GROWTH, "{name}: {grown} bytes more");
        }
    }
}

/// Waits until this viewer has 30 more frames, on the connection that it had.
fn frames_go_on(viewer: &Viewer, what: &str) {
    let before = viewer.statistics();
    wait_for(&format!("frames after {what}"), || {
        while viewer.next(Duration::ZERO).is_ok() {}
        let now = viewer.statistics();
        assert_eq!(now.sessions, 1, "{what}: it joined again");
        (now.frames >= before.frames + 30).then_some(())
    });
}

fn viewers(house: &House, link: &str, many: usize) -> Vec<Viewer> {
    let link: RoomLink = link.parse().expect("a link");
    Hall::of(house).fill(&link, many)
}

#[test]
fn a_host_without_a_link_ends_no_sender_by_packets() {
    let house = House::open();
    let sender = house.sender(&[]);
    let viewers = viewers(&house, &sender.viewers, 1);
    withstands(&sender.program, |what| frames_go_on(&viewers[0], what));
    drop(viewers);
    let sent = sender.program.ends();
    assert_eq!(count(&sent, "joined"), 1, "{sent:#}");
}

#[test]
fn a_host_without_a_link_ends_no_viewer_by_packets() {
    let house = House::open();
    let sender = house.sender(&[]);
    let mut viewer = house.receiver(&sender.viewers, "viewer", &[]);
    viewer.says("joined (session", 1);
    std::thread::sleep(Duration::from_secs(2));
    withstands(&viewer, |_| {});
    let seen = viewer.ends();
    let sent = sender.program.ends();
    let received = &seen["call"]["received"];
    assert_eq!(count(received, "sessions"), 1, "{seen:#}");
    let (frames, captured) = (count(received, "frames"), count(&sent, "sent"));
    // Nothing is lost on the loopback but where its buffers are full of what was not asked for.
    assert!(frames * 10 >= captured * 8, "{frames} of {captured}");
}

#[test]
fn a_host_without_a_link_ends_no_forwarding_server_by_packets() {
    let house = House::open_with(&["--forward"]);
    let sender = house.sender(&[]);
    let viewers = viewers(&house, &sender.viewers, DIRECT + 1);
    house.server_says("forwarding begins in room", 1);
    let forwarded = &viewers[DIRECT];
    withstands(house.server(), |what| {
        for viewer in &viewers {
            while viewer.next(Duration::ZERO).is_ok() {}
        }
        frames_go_on(forwarded, what);
    });
}

/// A program with a right link attacks the other end; returns its counts.
pub(super) fn attack(python: &str, who: &str, link: &str, attack: &str, more: &[&str]) -> Value {
    let times = extent(1, 5).to_string();
    let mut command = Command::new(python);
    command
        .arg(program("aiortc_attacker.py"))
        .args([who, link, "--attack", attack, "--times", &times])
        .args(["--seconds", "2", "--address", "127.0.0.1"])
        .args(more);
    let told = said(&service::output("aiortc's attacker", &mut command));
    println!("{who} {attack}: {told}");
    told
}

/// A room that awaits its sender, and the avatar that it may show.
pub(super) struct EmptyRoom {
    sender: String,
    pub(super) viewers: String,
    avatar: AvatarRef,
}

impl EmptyRoom {
    pub(super) fn open(house: &House) -> Self {
        let room = house.runtime.block_on(async {
            let client = Client::new(None).expect("a client");
            let server = format!("http://{}", house.address);
            let server: ServerUrl = server.parse().expect("an address");
            let token = house.owner_token();
            let put = client.put_package(&server, &token, &house.avatar, |_, _| {});
            put.await.expect("the package is taken");
            let room = client.open_room(&server, &token, None);
            room.await.expect("a room")
        });
        Self {
            sender: room.sender.to_string(),
            viewers: room.viewer.to_string(),
            avatar: AvatarRef::of_file(&house.avatar).expect("the package"),
        }
    }

    /// As [`attack`], by a sender in this room.
    pub(super) fn attack(&self, python: &str, name: &str) -> Value {
        let (hash, bytes) = (
            self.avatar.sha256.to_string(),
            self.avatar.bytes.to_string(),
        );
        let more = ["--sha256", &hash, "--bytes", &bytes];
        attack(python, "sender", &self.sender, name, &more)
    }
}

const ATTACKS: [&str; 9] = [
    "fragments",
    "early",
    "channels",
    "streams",
    "holes",
    "skips",
    "resets",
    "rtp",
    "rtcp",
];

#[test]
fn a_viewer_with_the_link_ends_no_sender_by_packets() {
    let Some(python) = python() else {
        return;
    };
    let house = House::open();
    let sender = house.sender(&["--codec", "paper"]);
    let viewers = viewers(&house, &sender.viewers, 1);
    // What each connection takes is not the attack's.
    attack(&python, "viewer", &sender.viewers, "fragments", &[]);
    frames_go_on(&viewers[0], "the first");
    let before = sender.program.resident_memory();
    for name in ATTACKS {
        let told = attack(&python, "viewer", &sender.viewers, name, &[]);
        assert!(count(&told, "sent") > 10, "{name}: {told}");
        frames_go_on(&viewers[0], name);
        let grown = sender.program.resident_memory().saturating_sub(before);
        println!("{name}: {} kB more", grown >> 10);
        assert!(grown <= GROWTH, "{name}: {grown} bytes more");
    }
}

#[test]
fn a_sender_with_the_link_ends_no_viewer_by_packets() {
    let Some(python) = python() else {
        return;
    };
    let house = House::open();
    let room = EmptyRoom::open(&house);
    let mut viewer = house.receiver(&room.viewers, "viewer", &[]);
    room.attack(&python, "fragments");
    assert!(viewer.is_running(), "{}", viewer.said());
    let before = viewer.resident_memory();
    for name in ATTACKS {
        let told = room.attack(&python, name);
        assert!(count(&told, "sent") > 10, "{name}: {told}");
        assert!(viewer.is_running(), "{name}: {}", viewer.said());
        let grown = viewer.resident_memory().saturating_sub(before);
        println!("{name}: {} kB more", grown >> 10);
        assert!(grown <= GROWTH, "{name}: {grown} bytes more");
    }
    let asked = Instant::now();
    let seen = viewer.ends();
    assert!(
        asked.elapsed() < Duration::from_secs(5),
        "it ends when asked"
    );
    assert!(count(&seen["call"]["received"], "sessions") > 0, "{seen:#}");
}
