//! Holders of a call link watch without a seat, take seats and disconnect members; holders of a room's link take every
//! place.

use super::relay::Relay;
use super::{Times, extent};
use crate::both_ways::{Host, host, prepare};
use crate::command::command;
use crate::handover::{Hall, ends};
use crate::house::{House, Program, wait_for};
use crate::member::Member;
use data_encoding::BASE64URL_NOPAD;
use identity::{Identity, Purpose};
use link_call::door::DoorRules;
use link_call::{CallError, CallEvent, Credentials, Door, Viewer};
use link_protocol::limits::SEAT_KEPT;
use link_protocol::{CallLink, Name, Refusal, RoomLink};
use ring::hmac;
use rustix::process::{Pid, Signal, kill_process};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::ChildStdin;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use test_support::speech::syllables;

fn types(stdin: &mut ChildStdin, line: &str) {
    writeln!(stdin, "{line}").expect("it listens");
    stdin.flush().expect("it listens");
}

/// A member with a key of their own, by `mon3tr call`.
fn member(house: &House, name: &str, arguments: &[&str]) -> (Program, ChildStdin) {
    let (cache, arguments) = prepare(house, name, &syllables(1), arguments);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut call = command(&arguments);
    let key = house.path(&format!("{name}.key"));
    call.env("MON3TR_KEY", key)
        .env("RUST_LOG", "link=info,warn");
    Program::start_steered(house, &cache, &mut call)
}

/// Ada, who opens a call with `more` arguments, and Bob; the call's link.
fn call_of_two(house: &House, host: &Host, more: &[&str]) -> ([(Program, ChildStdin); 2], String) {
    let mut ada = member(house, "ada", &[&host.arguments()[..], more].concat());
    let link = ada.0.word_after("mon3tr call ");
    let bob = member(house, "bob", &[&link]);
    ada.0.says("bob has joined", 1);
    ([ada, bob], link)
}

/// The status and the body of the answer to one request.
fn ask(address: SocketAddr, request: &str, token: &str, kind: &str, body: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(address).expect("the server is there");
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .expect("a timeout");
    let head = format!(
        "{request} HTTP/1.1\r\nHost: x\r\nConnection: close\r\nAuthorization: Bearer {token}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    );
    let mut answer = Vec::new();
    // Where the other side ends early, what came counts.
    let _ = stream.write_all(head.as_bytes());
    let _ = stream.read_to_end(&mut answer);
    let answer = String::from_utf8_lossy(&answer);
    let status = answer.split(' ').nth(1).and_then(|it| it.parse().ok());
    let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
    (status.unwrap_or(0), body.to_owned())
}

/// What shows that `who` has the link's secret and means `text`.
fn mac(link: &RoomLink, who: &str, text: &str) -> String {
    let secret = link.secret().expect("a secret").bytes();
    let secret = hmac::Key::new(hmac::HMAC_SHA256, secret);
    let key = hmac::sign(&secret, format!("mon3tr {who} 1\nlink").as_bytes());
    let key = hmac::Key::new(hmac::HMAC_SHA256, key.as_ref());
    BASE64URL_NOPAD.encode(hmac::sign(&key, text.as_bytes()).as_ref())
}

/// `media` as an offer with the proof that its maker has the link.
fn proved(link: &RoomLink, media: &str) -> String {
    let fingerprint = format!("sha-256 {}", ["aa"; 32].join(":"));
    let mac = mac(link, "viewer", &format!("{}\n{fingerprint}", link.room()));
    format!("v=0\r\na=fingerprint:{fingerprint}\r\na=mon3tr-link:{mac}\r\n{media}")
}

/// Waits until it has joined; how long that took.
fn joins(viewer: &Viewer) -> Duration {
    let begun = Instant::now();
    wait_for("a viewer to see somebody", || {
        (viewer.statistics().frames > 0).then_some(())
    });
    begun.elapsed()
}

#[test]
fn offers_of_which_no_connection_can_be_made_are_answered_and_keep_no_newcomer_out() {
    let house = House::open();
    let sender = house.sender(&[]);
    let link: RoomLink = sender.viewers.parse().expect("a link");
    let relay = Relay::from(&house, [127, 0, 0, 44]);
    let path = format!("POST /v1/rooms/{}/whep", link.room());
    let offer = |media: &str| {
        let (token, offer) = (link.token().secret(), proved(&link, media));
        ask(relay.address, &path, token, "application/sdp", &offer)
    };
    let forms = [
        "m=nonsense\r\n",
        "",
        "m=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\n",
        "m=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\na=mid:0\r\na=ice-ufrag:x\r\n",
        "m=audio 9 UDP/TLS/RTP/SAVPF 111\r\na=mid:0\r\na=rtpmap:111 opus/48000/2\r\n",
        "o=\r\ns=\r\nt=\r\nm=application 0 x y\r\nc=\r\n",
    ];
    for form in forms {
        let (status, answer) = offer(form);
        let is_refused = status == 201 && answer.contains("a=mon3tr-refused:");
        assert!(is_refused, "{form:?} is answered {status}: {answer}");
    }
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..36)
            .map(|number| {
                let (offer, over) = (&offer, &over);
                scope.spawn(move || {
                    while !over.load(Relaxed) {
                        offer(forms[number % forms.len()]);
                        std::thread::sleep(Duration::from_millis(100));
                    }
                })
            })
            .collect();
        std::thread::sleep(Duration::from_secs(2));
        let hall = Hall::of(&house);
        let mut newcomers = Times::of("joins beside offers that cannot be read");
        for _ in 0..extent(3, 20) {
            let viewer = hall.join_as(&link, hall.authentication.clone());
            newcomers.add(joins(&viewer));
        }
        over.store(true, Relaxed);
        for thread in threads {
            thread.join().expect("no panic");
        }
    });
    sender.program.ends();
}

/// How a viewer that is refused ends.
fn assert_refused(viewer: &Viewer, why: Refusal) {
    let end = ends(viewer);
    assert!(
        matches!(&end, CallEvent::Failed(CallError::Refused(refusal)) if *refusal == why),
        "{end:?}"
    );
    let statistics = viewer.statistics();
    assert_eq!(
        (statistics.frames, statistics.voice),
        (0, 0),
        "nothing came"
    );
}

#[test]
fn a_viewer_whose_key_sits_in_no_seat_of_a_call_sees_and_hears_nobody() {
    let house = House::open();
    let host = host(&house);
    let ([mut ada, bob], link) = call_of_two(&house, &host, &[]);
    let eve = Member::of(&house, &link, 66);
    for person in ["ada", "bob"] {
        let seat = eve.seat_of(person);
        // By the program, as a room's link ...
        let (room, json) = (eve.link.seat(&seat).to_string(), house.new_report());
        let mut receive = command(&["receive", &room, "--display", "none", "--json", &json]);
        receive.env("MON3TR_KEY", house.path("eve.key"));
        let cache = house.folder.path().join("eve");
        let said = Program::start_as(&house, &cache, &mut receive).fails();
        assert!(said.contains("only those who sit in the call"), "{said}");
        // ... with another key, and without one.
        assert_refused(&eve.watches(&seat), Refusal::Seat);
        assert_refused(&eve.watches_as(&seat, None), Refusal::Seat);
    }
    ada.0.says("it sits in no seat of the call", 1);
    types(&mut ada.1, "w");
    ada.0.says("sees and hears you", 1);
    let said = ada.0.said();
    let viewers = said.lines().filter(|line| line.contains("sees and hears"));
    let viewers: Vec<_> = viewers.collect();
    assert!(
        matches!(viewers[..], [line] if line.contains("bob, the key")),
        "{viewers:?}"
    );
    for (program, _) in [ada, bob] {
        program.ends();
    }
}

#[test]
fn a_member_who_leaves_the_seat_and_goes_on_watching_is_disconnected() {
    let house = House::open();
    let host = host(&house);
    let ([mut ada, bob], link) = call_of_two(&house, &host, &[]);
    let eve = Member::of(&house, &link, 67);
    let seat = eve.seat_of("ada");
    let sits = eve.sits("eve").expect("a seat is free");
    let watches = eve.watches(&seat);
    joins(&watches);
    let fingerprint = eve.own.key().fingerprint();
    types(&mut ada.1, "w");
    ada.0
        .says(&format!("the key {fingerprint} sees and hears you"), 1);
    // Another viewer with a key that sits nowhere is refused meanwhile.
    let other = Credentials::new(Identity::from_seed(&[68; 32]).expect("a key"));
    assert_refused(&eve.watches_as(&seat, Some(other)), Refusal::Seat);
    house.runtime.block_on(sits.hang_up());
    let left = Instant::now();
    let end = ends(&watches);
    println!("{end:?} after {:?}", left.elapsed());
    assert!(
        matches!(end, CallEvent::Failed(CallError::Refused(Refusal::Seat))),
        "{end:?}"
    );
    ada.0.says("its key sits in the call no longer", 1);
    for (program, _) in [ada, bob] {
        program.ends();
    }
}

#[test]
fn a_member_who_watches_and_answers_no_one_is_reported_and_can_be_sent_away() {
    let house = House::open();
    let host = host(&house);
    let ([mut ada, bob], link) = call_of_two(&house, &host, &[]);
    let eve = Member::of(&house, &link, 69);
    let call = eve.link.call();
    let identity = Identity::from_seed(&[69; 32]).expect("a key");
    let proof = format!(
        "a=mon3tr-link:{}\r\na=mon3tr-key:{}\r\n",
        mac(&eve.link.seat(call), "member", call.as_str()),
        identity.sign_as_text(Purpose::Member, call.as_str().as_bytes())
    );
    let seats = eve.status().seats;
    let free = seats.iter().find(|seat| seat.taken.is_none());
    let free = free.expect("a free seat").room.clone();
    let (status, _presence) = sits(&house, house.address, &eve.link, &free, Some(&proof));
    assert_eq!(status, 200);
    let watches = eve.watches(&eve.seat_of("ada"));
    joins(&watches);
    let sends_away = format!("x {}", identity.public().fingerprint());
    ada.0.says(
        &format!("is not shown: you neither see nor hear them; `{sends_away}`"),
        1,
    );
    types(&mut ada.1, &sends_away);
    let end = ends(&watches);
    assert!(
        matches!(end, CallEvent::Failed(CallError::Refused(Refusal::Removed))),
        "{end:?}"
    );
    for (program, _) in [ada, bob] {
        program.ends();
    }
}

#[test]
fn a_member_who_watches_and_refuses_every_offer_is_reported() {
    let house = House::open();
    let host = host(&house);
    let ([mut ada, bob], link) = call_of_two(&house, &host, &["--seats-per-address", "4"]);
    let asks = DoorRules {
        ask: true,
        ..DoorRules::default()
    };
    let locked = DoorRules {
        locked: true,
        ..DoorRules::default()
    };
    for (seed, rules) in [(74, asks), (75, locked)] {
        let eve = Member::of(&house, &link, seed);
        let seat = eve.seat_of("ada");
        let sits = eve.sits_with(&format!("eve{seed}"), Door::new(rules));
        let sits = sits.expect("a seat is free");
        let watches = eve.watches(&seat);
        joins(&watches);
        let key = eve.own.key().fingerprint();
        ada.0.says(
            &format!("the key {key}, sees and hears you and is not shown"),
            1,
        );
        drop(watches);
        house.runtime.block_on(sits.hang_up());
    }
    for (program, _) in [ada, bob] {
        program.ends();
    }
}

#[test]
fn a_member_who_is_sent_away_stays_away_and_a_locked_call_takes_nobody_new() {
    let house = House::open();
    let host = host(&house);
    let more = ["--seats-per-address", "4"];
    let ([mut ada, mut bob], link) = call_of_two(&house, &host, &more);
    let (mut eve, _eves) = member(&house, "eve", &[&link]);
    for (program, _) in [&mut ada, &mut bob] {
        program.says("eve has joined", 1);
    }
    eve.says("joined (session", 2);
    let fingerprint = {
        let said = ada.0.said();
        let line = said
            .lines()
            .find(|line| line.starts_with("eve is new to you"))
            .map(str::to_owned);
        let line = line.expect("her key is told");
        line.rsplit(' ').next().expect("a word").to_owned()
    };
    // Seats have numbers, too: no number sends away one who is in the call.
    types(&mut ada.1, "x 1");
    ada.0.says("no person with the number 1 waits", 1);
    types(&mut ada.1, &format!("x {fingerprint}"));
    ada.0.says("is sent away, and does not come in again", 1);
    ada.0.says("eve has left", 1);
    eve.says("ada has left", 1);
    assert!(
        !bob.0.said().contains("eve has left"),
        "Bob decides for himself"
    );
    // Also by another program with her key, and when Ada has come back, maybe to another place.
    eve.ask_to_end();
    bob.0.says("eve has left", 1);
    ada.0.ends();
    let (ada, mut adas) = member(&house, "ada", &[&link]);
    let mut ada = (ada, ());
    ada.0.says("bob has joined", 1);
    let (again, _eves) = member(&house, "eve", &[&link]);
    bob.0.says("eve has joined", 2);
    let eve_at = |ada: &Program| ada.said().contains("eve has joined");
    // Long enough for several questions who is there.
    std::thread::sleep(Duration::from_secs(3));
    assert!(!eve_at(&ada.0), "{}", ada.0.said());
    types(&mut adas, "w");
    ada.0.says("in the call: you; ", 1);
    assert!(!ada.0.said().contains(&fingerprint), "{}", ada.0.said());

    // A locked call: Zoe meets Bob, who has not locked it, and not Ada.
    types(&mut adas, "l");
    ada.0.says("the call is locked for you", 1);
    let (mut zoe, _zoes) = member(&house, "zoe", &[&link]);
    bob.0.says("zoe has joined", 1);
    zoe.says("bob has joined", 1);
    assert!(!ada.0.said().contains("zoe has joined"), "{}", ada.0.said());
    types(&mut adas, "l");
    ada.0.says("the call is open for you again", 1);
    ada.0.says("zoe has joined", 1);
    zoe.says("ada has joined", 1);
    assert!(!zoe.said().contains("is not shown: you"), "{}", zoe.said());
    assert!(!eve_at(&ada.0), "{}", ada.0.said());
    for program in [ada.0, bob.0, zoe, again] {
        program.ask_to_end();
    }
}

/// Wants to sit down in this seat, by way of `address`, and shows `proof` to the members; the status, and the presence
/// while it is kept.
fn sits(
    house: &House,
    address: SocketAddr,
    link: &CallLink,
    seat: &Name,
    proof: Option<&str>,
) -> (u16, TcpStream) {
    let avatar = link_protocol::announcement::AvatarRef::of_file(&house.avatar).expect("a package");
    let body = serde_json::json!({
        "avatar": avatar, "channel": "unreliable", "codec": "paper", "rate_hz": 30.0,
        "person": "Eve", "occupant": format!("o{}", seat.as_str()), "proof": proof,
    })
    .to_string();
    let mut stream = TcpStream::connect(address).expect("the server is there");
    let head = format!(
        "POST /v1/rooms/{seat}/presence HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {}\r\nContent-Length: {}\r\n\r\n{body}",
        link.token().secret(),
        body.len()
    );
    stream.write_all(head.as_bytes()).expect("asked");
    let mut status = [0; 12];
    stream.read_exact(&mut status).expect("answered");
    let status = std::str::from_utf8(&status[9..]).map(str::parse);
    (status.expect("text").expect("a status"), stream)
}

#[test]
fn a_link_holder_takes_no_more_than_three_seats_and_friends_get_in() {
    let house = House::open();
    let host = host(&house);
    let (mut ada, _lines) = member(&house, "ada", &host.arguments());
    let link = ada.word_after("mon3tr call ");
    ada.says("you are in the call", 1);
    let eve = Member::of(&house, &link, 70);
    let relay = Relay::from(&house, [127, 0, 0, 66]);
    let seats = eve.status().seats;
    let taken: Vec<_> = seats
        .iter()
        .map(|seat| sits(&house, relay.address, &eve.link, &seat.room, None))
        .collect();
    let statuses: Vec<u16> = taken.iter().map(|(status, _)| *status).collect();
    assert_eq!(statuses, [409, 200, 200, 200, 403, 403, 403, 403]);
    // A seat that she leaves is kept for her, and counts.
    drop(taken);
    wait_for("her seats to be kept", || {
        let kept = eve.status().seats.iter().filter(|seat| seat.kept).count();
        (kept == 3).then_some(())
    });
    let (again, _) = sits(&house, relay.address, &eve.link, &seats[5].room, None);
    assert_eq!(again, 403, "hers are kept still");
    let (mut bob, _lines) = member(&house, "bob", &[&link]);
    bob.says("you are in the call", 1);
    ada.says("bob has joined", 1);
    // While she has three, nobody else gets in from her address.
    let all: Vec<_> = seats
        .iter()
        .map(|seat| sits(&house, relay.address, &eve.link, &seat.room, None))
        .collect();
    let said = member(&house, "late", &[&relay.link(&house, &link)])
        .0
        .fails();
    assert!(said.contains("this network address has 3 seats"), "{said}");
    drop(all);
    for program in [ada, bob] {
        program.ends();
    }
}

#[test]
fn members_keep_their_seats_while_a_link_holder_takes_every_other_one_and_falls_silent() {
    let house = House::open();
    let host = host(&house);
    let ([mut ada, mut bob], link) = call_of_two(&house, &host, &[]);
    let relay = Relay::from(&house, [127, 0, 0, 67]);
    let (eve, _lines) = member(&house, "eve", &[&relay.link(&house, &link)]);
    for (program, _) in [&mut ada, &mut bob] {
        program.says("eve has joined", 1);
    }
    let watcher = Member::of(&house, &link, 71);
    let [adas, bobs] = ["ada", "bob"].map(|person| watcher.seat_of(person));
    let seats = watcher.status().seats;
    let all: Vec<_> = seats
        .iter()
        .map(|seat| sits(&house, relay.address, &watcher.link, &seat.room, None))
        .collect();
    // Her viewers are silent again and again, long enough for a connection to be doubted.
    let pid = Pid::from_raw(i32::try_from(eve.id()).expect("a number")).expect("a process");
    let until = Instant::now() + Duration::from_secs(extent(8, 60).into());
    let mut next = Instant::now();
    let mut stopped = false;
    let mut polls = 0;
    while Instant::now() < until {
        if Instant::now() >= next {
            let (signal, pause) = if stopped {
                (Signal::CONT, 300)
            } else {
                (Signal::STOP, 900)
            };
            kill_process(pid, signal).expect("it runs");
            (stopped, next) = (!stopped, Instant::now() + Duration::from_millis(pause));
        }
        let names: Vec<_> = watcher
            .status()
            .seats
            .into_iter()
            .filter_map(|seat| Some((seat.room, seat.taken?.person?)))
            .collect();
        for (seat, person) in [(&adas, "ada"), (&bobs, "bob")] {
            let sits = names.iter().find(|(room, _)| room == seat);
            let name = sits.map(|(_, name)| name.as_str());
            assert_eq!(name, Some(person), "after {polls} polls: {names:?}");
            if polls % 20 == 0 {
                let (status, _) = self::sits(&house, relay.address, &watcher.link, seat, None);
                assert_eq!(status, 409, "{person}'s seat is taken");
            }
        }
        polls += 1;
        // Within what the server takes from one address.
        std::thread::sleep(Duration::from_millis(30));
    }
    kill_process(pid, Signal::CONT).expect("it runs");
    println!("{polls} times the seats were asked for");
    drop(all);
    // The seat of who is killed is kept for a while.
    bob.0.kill();
    let killed = Instant::now();
    wait_for("Bob's seat to be kept", || {
        let seats = watcher.status().seats;
        let kept = seats.iter().find(|seat| seat.room == bobs)?.kept;
        kept.then_some(())
    });
    let (status, _) = sits(&house, relay.address, &watcher.link, &bobs, None);
    assert_eq!(status, 409, "Bob's seat is kept for him");
    wait_for("Bob's seat to be free", || {
        let seats = watcher.status().seats;
        let kept = seats.iter().find(|seat| seat.room == bobs)?.kept;
        (!kept).then_some(())
    });
    assert!(killed.elapsed() >= SEAT_KEPT, "{:?}", killed.elapsed());
    assert!(!ada.0.said().contains("another one is taken"));
    ada.0.says("bob has left", 1);
    eve.ask_to_end();
    ada.0.ends();
}

#[test]
fn a_link_holder_with_every_place_of_a_room_makes_room_for_newcomers() {
    let house = House::open();
    let sender = house.sender(&[]);
    let link: RoomLink = sender.viewers.parse().expect("a link");
    let relay = Relay::from(&house, [127, 0, 0, 9]);
    let hers: RoomLink = relay.link(&house, &sender.viewers).parse().expect("a link");
    let hall = Hall::of(&house);
    let keyed = |seed: u8| {
        let mut authentication = hall.authentication.clone();
        let own = Identity::from_seed(&[seed; 32]).expect("a key");
        authentication.own = Some(Credentials::new(own));
        authentication
    };
    // Each of hers has another key.
    let eve: Vec<_> = (0..32)
        .map(|seed| {
            let viewer = hall.join_as(&hers, keyed(seed + 1));
            joins(&viewer);
            viewer
        })
        .collect();
    let refused = hall.join_as(&hers, keyed(99));
    wait_for("her next one to be refused", || {
        let why = refused.statistics().not_joined?;
        why.contains("as many viewers").then_some(())
    });
    // Of another address, with a key and without one; they stay.
    let newcomers = [keyed(100), hall.authentication.clone(), keyed(101)];
    let mut times = Times::of("joins beside a holder of every place");
    let newcomers = newcomers.map(|authentication| {
        let viewer = hall.join_as(&link, authentication);
        times.add(joins(&viewer));
        viewer
    });
    let before = newcomers.each_ref().map(|it| it.statistics().frames);
    std::thread::sleep(Duration::from_secs(3));
    for (viewer, before) in newcomers.iter().zip(before) {
        let statistics = viewer.statistics();
        assert_eq!(statistics.sessions, 1, "nobody takes their place");
        assert!(statistics.frames > before, "{statistics:?}");
    }
    drop((eve, refused));
    sender.program.ends();
}
