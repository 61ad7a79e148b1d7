//! A server in the middle changes offers, answers and names.

mod middle;

use super::packets::{EmptyRoom, attack};
use crate::both_ways::{begin, host};
use crate::command::command;
use crate::house::{House, Program, count, wait_for};
use crate::interop::python;
use link_call::forward::Forwarder;
use link_http::Client;
use link_playout::Clock;
use link_protocol::RoomLink;
use middle::{Middle, Passes};
use std::net::UdpSocket;
use std::time::{Duration, Instant};
use test_support::speech::syllables;

/// How a line is hidden from a reader that takes lines as they are, and not from one that trims them.
const HIDDEN: [&str; 6] = ["a= ", "\ra=", "a=\u{a0}", "a=\t", "\r\n a=", "a=\u{b}"];

/// A certificate of the server's own.
fn evil() -> String {
    format!("sha-256 EE{}", ":11".repeat(31))
}

/// `sdp` with a certificate of the server's own before each genuine one, in a line that begins so.
fn with_certificate(begins: &str, sdp: &str) -> String {
    let line = format!("{begins}fingerprint:{}\r\na=fingerprint:", evil());
    sdp.replace("a=fingerprint:", &line)
}

/// The same of an SDP in JSON.
fn with_certificate_in_json(begins: &str, json: &str) -> String {
    let begins = serde_json::to_string(begins).expect("a text");
    let line = format!(
        "{}fingerprint:{}\\r\\na=fingerprint:",
        begins.trim_matches('"'),
        evil()
    );
    json.replace("a=fingerprint:", &line)
}

/// The same link by way of `middle`.
fn by(middle: &Middle, link: &str) -> String {
    let link: RoomLink = link.parse().expect("a room's link");
    let server = format!("http://{}", middle.address);
    link.at(server.parse().expect("an address")).to_string()
}

/// That a viewer has seen nothing, and said why.
fn assert_refused(viewer: Program, why: &str) {
    let said = viewer.fails();
    assert!(said.contains(why), "{said}");
    assert!(!said.contains("joined (session"), "{said}");
}

const CHANGED: &str = "what the other side says of its connection is refused";

#[test]
fn a_viewer_takes_no_answer_with_a_hidden_certificate() {
    let house = House::open();
    let sender = house.sender(&[]);
    for begins in HIDDEN {
        let middle = Middle::start(house.address, move |passes, text| match passes {
            Passes::Answer => with_certificate(begins, text),
            _ => text.to_owned(),
        });
        let viewer = house.receiver(&by(&middle, &sender.viewers), "viewer", &[]);
        assert_refused(viewer, CHANGED);
        assert!(middle.changed() > 0, "{begins:?}");
    }
    // The middle itself is no hindrance.
    let middle = Middle::start(house.address, |_, text| text.to_owned());
    let mut viewer = house.receiver(&by(&middle, &sender.viewers), "viewer", &[]);
    viewer.says("joined (session", 1);
    viewer.ends();
    let sent = sender.program.ends();
    assert_eq!(count(&sent, "joined"), 1, "{sent:#}");
}

#[test]
fn a_sender_takes_no_offer_with_a_hidden_certificate() {
    let house = House::open();
    let sender = house.sender(&[]);
    for begins in HIDDEN {
        let middle = Middle::start(house.address, move |passes, text| match passes {
            Passes::Offer => with_certificate(begins, text),
            _ => text.to_owned(),
        });
        let viewer = house.receiver(&by(&middle, &sender.viewers), "viewer", &[]);
        assert_refused(viewer, "whole link");
    }
    let sent = sender.program.ends();
    assert_eq!(count(&sent, "joined"), 0, "{sent:#}");
    assert_eq!(count(&sent, "sent"), 0, "{sent:#}");
}

#[test]
fn members_of_a_call_take_no_answer_and_no_offer_with_a_hidden_certificate() {
    let house = House::open();
    let host = host(&house);
    let mut ada = begin(&house, "ada", &syllables(1), &host.arguments());
    let link = ada.word_after("mon3tr call ");
    ada.says("you are in the call", 1);
    let middle = Middle::start(house.address, |passes, text| match passes {
        Passes::Answer | Passes::SentAnswer => with_certificate("a= ", text),
        Passes::Event => with_certificate_in_json("\ra=", text),
        _ => text.to_owned(),
    });
    let theirs = link.replace(&house.address.to_string(), &middle.address.to_string());
    assert_ne!(theirs, link);
    let mut bob = begin(&house, "bob", &syllables(2), &[&theirs]);
    bob.says("you are in the call", 1);
    // Each of them asks the other several times, and takes neither offer nor answer.
    wait_for("several changed texts", || {
        (middle.changed() > 3).then_some(())
    });
    std::thread::sleep(Duration::from_secs(1));
    for person in [ada, bob] {
        let said = person.said();
        assert!(!said.contains("has joined"), "{said}");
        assert!(!said.contains("(session"), "{said}");
    }
}

#[test]
fn forwarders_take_no_answer_with_a_hidden_certificate_and_are_sent_nothing() {
    // The server's own, which the sender meets by an offer in its presence.
    let house = House::open_with(&["--forward", "20"]);
    let middle = Middle::start(house.address, |passes, text| match passes {
        Passes::Event if text.contains("\"forwards\":true") => {
            with_certificate_in_json("a= ", text)
        }
        _ => text.to_owned(),
    });
    let genuine = house.sender(&[]);
    let own = by(&middle, &genuine.own);
    genuine.program.ends();
    let avatar = house.avatar.to_str().expect("UTF-8").to_owned();
    let sender = house.send(&["--room", &own, "--avatar", &avatar]);
    let link: RoomLink = genuine.viewers.parse().expect("a link");
    let viewers: Vec<Program> = (0..9)
        .map(|number| {
            let mut viewer = house.receiver(&link.to_string(), &format!("viewer {number}"), &[]);
            match number {
                0..8 => viewer.says("joined (session", 1),
                _ => wait_for("a changed offer", || (middle.changed() > 1).then_some(())),
            }
            viewer
        })
        .collect();
    assert!(
        !viewers[8].said().contains("joined (session"),
        "{}",
        viewers[8].said()
    );
    drop(viewers);
    let sent = sender.ends();
    assert_eq!(count(&sent, "joined"), 8, "no forwarder: {sent:#}");
    // One that a person runs, with the link.
    let sender = house.sender(&[]);
    let middle = Middle::start(house.address, |passes, text| match passes {
        Passes::Answer => with_certificate("a= ", text),
        _ => text.to_owned(),
    });
    let forwarded = house.runtime.block_on(async {
        let client = Client::new(None).expect("a client");
        let server = format!("http://{}", house.address)
            .parse()
            .expect("an address");
        let audience = client.open_room(&server, &house.owner_token(), None).await;
        let source = by(&middle, &sender.viewers).parse().expect("a link");
        let audience = audience.expect("a room").sender;
        let begun = Forwarder::begin(client, source, audience, 4, None, Clock::start());
        let forwarder = begun.await.expect("the sender is there");
        while middle.changed() < 3 {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        forwarder.end().await
    });
    assert_eq!(
        (forwarded.messages, forwarded.voice),
        (0, 0),
        "{forwarded:?}"
    );
    let sent = sender.program.ends();
    assert_eq!(count(&sent, "sent"), 0, "{sent:#}");
}

#[test]
fn a_side_with_another_certificate_than_it_signed_is_sent_and_shows_nothing() {
    let Some(python) = python() else {
        return;
    };
    let house = House::open();
    let mut sender = house.sender(&["--codec", "paper"]);
    let counts = attack(&python, "viewer", &sender.viewers, "certificate", &[]);
    assert!(count(&counts, "sent") > 0, "DTLS did not begin: {counts}");
    assert_eq!(count(&counts, "frames"), 0, "{counts}");
    sender.program.says("a viewer could not join", 1);
    let sent = sender.program.ends();
    assert_eq!(count(&sent, "sent"), 0, "{sent:#}");

    let room = EmptyRoom::open(&house);
    let mut receive = command(&["receive", &room.viewers, "--display", "none"]);
    receive.env("RUST_LOG", "link_call=debug");
    let cache = house.folder.path().join("viewer");
    let mut viewer = Program::start_as(&house, &cache, &mut receive);
    let counts = room.attack(&python, "certificate");
    assert!(count(&counts, "sent") > 0, "DTLS did not begin: {counts}");
    viewer.says("not joined yet: ", 1);
    viewer.ask_to_end();
    let said = viewer.fails();
    let why = "does not show the certificate that it signed";
    assert!(
        said.contains(&format!(
            "it never began: packets pass between the two sides, but the other one {why}"
        )),
        "{said}"
    );
    assert!(!said.contains("joined (session"), "{said}");
}

/// `mon3tr call` as `name`, with a key of their own.
fn begin_with_key(house: &House, name: &str, arguments: &[&str]) -> Program {
    let (cache, arguments) = crate::both_ways::prepare(house, name, &syllables(1), arguments);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut command = command(&arguments);
    command
        .env("RUST_LOG", "link=info")
        .env("MON3TR_KEY", house.path(&format!("{name}.key")));
    Program::start_as(house, &cache, &mut command)
}

#[test]
fn a_server_that_exchanges_names_has_neither_shown_nor_remembered() {
    let house = House::open();
    let host = host(&house);
    let mut ada = begin_with_key(&house, "ada", &host.arguments());
    let link = ada.word_after("mon3tr call ");
    let mut bob = begin_with_key(&house, "bob", &[&link]);
    bob.says("ada has joined", 1);
    let middle = Middle::start(house.address, |passes, text| match passes {
        Passes::People => {
            let marked = text
                .replace("\"ada\"", "\"\u{1}\"")
                .replace("\"bob\"", "\"ada\"");
            marked.replace('\u{1}', "bob")
        }
        _ => text.to_owned(),
    });
    let theirs = link.replace(&house.address.to_string(), &middle.address.to_string());
    let mut eve = begin_with_key(&house, "eve", &[&theirs]);
    for words in [
        "ada has joined",
        "bob has joined",
        "ada is new to you",
        "bob is new to you",
    ] {
        eve.says(words, 1);
    }
    let said = eve.said();
    let opener = said
        .lines()
        .find(|line| line.contains("who opened the call"));
    let opener = opener.expect("ada is there");
    assert!(opener.contains("ada is new to you"), "{opener}");
    let met = std::fs::read_to_string(house.path("eve.met")).expect("whom eve has met");
    for name in ["ada", "bob"] {
        let mut keys = command(&["keys"]);
        keys.env("MON3TR_KEY", house.path(&format!("{name}.key")));
        let shown = crate::command::Outcome::of(&mut keys).succeeds();
        let line = met.lines().find(|line| line.ends_with(&format!(" {name}")));
        let key = line
            .and_then(|line| line.split(' ').next())
            .expect("a line");
        assert!(shown.contains(key), "{name}: {met} {shown}");
    }
    for person in [eve, bob, ada] {
        person.ask_to_end();
        person.report();
    }
}

#[test]
fn hidden_candidates_have_a_sender_send_nothing_and_plain_ones_to_few_addresses() {
    let house = House::open();
    let sender = house.sender(&[]);
    // Where packets would arrive: 400 ports of 200 addresses of this machine.
    let places: Vec<UdpSocket> = (0..400u16)
        .map(|number| {
            let address = [127, 0, 7, u8::try_from(number % 200 + 10).expect("a byte")];
            let socket = UdpSocket::bind((std::net::Ipv4Addr::from(address), 0));
            let socket = socket.expect("the loopback has this address");
            socket.set_nonblocking(true).expect("a socket");
            socket
        })
        .collect();
    let candidates = |begins: &str| -> String {
        let lines = places.iter().enumerate().map(|(number, place)| {
            let address = place.local_addr().expect("an address");
            let priority = 2_130_706_431 - number;
            format!(
                "{begins}candidate:{number} 1 udp {priority} {} {} typ host\r\n",
                address.ip(),
                address.port()
            )
        });
        lines.collect()
    };
    let reached = |within: Duration| {
        let until = Instant::now() + within;
        let mut reached = std::collections::BTreeSet::new();
        let mut bytes = [0; 2048];
        while Instant::now() < until {
            for (number, place) in places.iter().enumerate() {
                while place.recv_from(&mut bytes).is_ok() {
                    reached.insert(number);
                }
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        reached.len()
    };
    for begins in HIDDEN {
        let lines = candidates(begins);
        let middle = Middle::start(house.address, move |passes, text| match passes {
            Passes::Offer => text.replacen("a=candidate:", &format!("{lines}a=candidate:"), 1),
            _ => text.to_owned(),
        });
        let viewer = house.receiver(&by(&middle, &sender.viewers), "viewer", &[]);
        assert_refused(viewer, "whole link");
        assert_eq!(reached(Duration::from_millis(500)), 0, "{begins:?}");
    }
    let lines = candidates("a=");
    let middle = Middle::start(house.address, move |passes, text| match passes {
        Passes::Offer => text.replacen("a=candidate:", &format!("{lines}a=candidate:"), 1),
        _ => text.to_owned(),
    });
    let viewer = house.receiver(&by(&middle, &sender.viewers), "viewer", &[]);
    wait_for("a changed offer", || (middle.changed() > 0).then_some(()));
    let places = reached(Duration::from_secs(3));
    assert!((1..=4).contains(&places), "{places} places were sent to");
    drop(viewer);
    sender.program.ends();
}
