//! A room's door: newcomers wait to be let in, guests have links of their own, and whoever is sent away stays away.

use crate::audience::frames;
use crate::command::command;
use crate::handover::{DIRECT, Hall, ends};
use crate::house::{House, Program};
use crate::voice::write_wav;
use identity::Identity;
use link_call::{Authentication, CallError, CallEvent, Credentials, Viewer};
use link_protocol::{Refusal, RoomLink};
use std::io::Write;
use std::path::Path;
use std::process::ChildStdin;
use std::time::{Duration, Instant};
use test_support::service::LONGEST_WAIT;
use test_support::speech::syllables;

fn types(stdin: &mut ChildStdin, line: &str) {
    writeln!(stdin, "{line}").expect("it listens");
    stdin.flush().expect("it listens");
}

/// A sender that does what is typed.
fn performer(house: &House, arguments: &[&str]) -> (Program, ChildStdin) {
    let (token, json) = (house.owner_token(), house.new_report());
    let (server, avatar) = (format!("http://{}", house.address), house.avatar.clone());
    let mut send = command(&["send", "--owner-token", &token, "--json", &json]);
    send.args(["--avatar", avatar.to_str().expect("UTF-8")]);
    if !arguments.contains(&"--room") {
        send.args(["--server", &server]);
    }
    send.args(arguments).env("RUST_LOG", "link=info");
    Program::start_steered(house, Path::new(&house.path("performer")), &mut send)
}

/// Someone with a key of their own, who watches by this link.
fn watcher(house: &House, link: &str, name: &str) -> Program {
    let json = house.new_report();
    let mut receive = command(&["receive", link, "--display", "none", "--json", &json]);
    let key = house.path(&format!("{name}.key"));
    receive
        .env("MON3TR_KEY", key)
        .env("RUST_LOG", "link=info,warn");
    Program::start_as(house, Path::new(&house.path(name)), &mut receive)
}

#[test]
fn newcomers_wait_until_they_are_let_in_and_whoever_is_sent_away_stays_away() {
    let house = House::open();
    let (mut ada, mut lines) = performer(&house, &["--ask"]);
    let link = ada.word_after("mon3tr receive ");
    let own = ada.word_after("comes back with --room ");
    let mut bob = watcher(&house, &link, "bob");
    ada.says("wants to come in: type a 1", 1);
    bob.says("the other side is asked to let you in", 1);
    assert!(!bob.said().contains("joined (session"), "{}", bob.said());
    types(&mut lines, "a 1");
    bob.says("joined (session", 1);
    ada.says("sees you (number 1)", 1);

    let mut eve = watcher(&house, &link, "eve");
    ada.says("wants to come in: type a 2", 1);
    types(&mut lines, "x 2");
    eve.says("the other side has sent you away", 1);
    assert!(eve.fails().contains("sent you away"));

    types(&mut lines, "l");
    ada.says("the room is locked", 1);
    let zoe = watcher(&house, &link, "zoe");
    assert!(zoe.fails().contains("the room is locked"));
    // Who was inside comes in again.
    bob.kill();
    let mut bob = watcher(&house, &link, "bob");
    bob.says("joined (session", 1);
    ada.says("sees you (number", 2);
    types(&mut lines, "w");
    ada.says("sees you", 3);

    types(&mut lines, "x 1");
    assert!(bob.fails().contains("sent you away"));
    types(&mut lines, "q");
    let (_, said) = ada.report_and_said();
    assert!(said.contains("is sent away"), "{said}");

    // What was decided holds when the room is entered again.
    let (mut ada, mut lines) = performer(&house, &["--room", &own]);
    let bob = watcher(&house, &link, "bob");
    assert!(bob.fails().contains("sent you away"));
    let zoe = watcher(&house, &link, "zoe");
    assert!(zoe.fails().contains("the room is locked"));
    types(&mut lines, "l");
    ada.says("the room is open again", 1);
    let zoe = watcher(&house, &link, "zoe");
    ada.says("wants to come in", 1);
    types(&mut lines, "a 1");
    ada.says("sees you (number 1)", 1);
    zoe.kill();
}

/// The link of this guest, as the performer was told it.
fn guests_link(ada: &mut Program, name: &str) -> RoomLink {
    let told = format!("{name} joins with");
    ada.says(&told, 1);
    let said = ada.said();
    let (_, after) = said.rsplit_once(&told).expect("it was said");
    let link = after.split('\'').nth(1).expect("a link in quotes");
    link.parse().expect("a link")
}

fn joins(hall: &Hall<'_>, link: &RoomLink, seed: u8) -> Viewer {
    let own = Identity::from_seed(&[seed; 32]).expect("a key");
    let authentication = Authentication {
        own: Some(Credentials::new(own)),
        ..hall.authentication.clone()
    };
    hall.join_as(link, authentication)
}

fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let until = Instant::now() + LONGEST_WAIT;
    while !holds() {
        assert!(Instant::now() < until, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_guests_link_is_theirs_alone_and_gives_what_it_says() {
    let house = House::open();
    let spoken = house.path("said.wav");
    write_wav(&spoken, link_voice::RATE, &syllables(1));
    let guests = ["--guest", "Bob,see", "--guest", "Zoe,1h"];
    let (mut ada, mut lines) = performer(&house, &[&guests[..], &["--voice", &spoken]].concat());
    let (bobs, zoes) = (guests_link(&mut ada, "Bob"), guests_link(&mut ada, "Zoe"));
    assert!(!ada.said().contains("Others join with"), "guests alone");
    let hall = Hall::of(&house);
    let (bob, zoe) = (joins(&hall, &bobs, 11), joins(&hall, &zoes, 12));
    ada.says("Bob (key", 1);
    ada.says("Zoe (key", 1);
    wait_for("Zoe to hear", || zoe.statistics().voice > 50);
    let (seen, heard) = (bob.statistics().frames, bob.statistics().voice);
    assert!(seen > 10 && heard == 0, "Bob sees: {seen}, hears: {heard}");

    // The link without what makes it a guest's, or with another guest's name.
    let (open, _) = zoes
        .to_string()
        .split_once(":guest=")
        .map(|(link, pass)| (link.to_owned(), pass.to_owned()))
        .expect("a pass");
    let stranger = joins(&hall, &open.parse().expect("a link"), 13);
    let end = ends(&stranger);
    assert!(
        matches!(end, CallEvent::Failed(CallError::Refused(Refusal::Link))),
        "{end:?}"
    );
    let pass = bobs.guest().expect("Bob's").clone();
    let mut forged = zoes.guest().expect("Zoe's").clone();
    forged.secret = pass.secret;
    let token = zoes.token().clone();
    let end = ends(&joins(&hall, &zoes.clone().for_guest(token, forged), 14));
    assert!(
        matches!(end, CallEvent::Failed(CallError::Refused(Refusal::Link))),
        "{end:?}"
    );

    // Zoe is sent away: by the performer's program, and by the server, which tells her nothing more.
    let number = |said: &str| {
        let (_, after) = said.rsplit_once("Zoe (key").expect("she came");
        let (_, number) = after.split_once("(number ").expect("a number");
        number.split(')').next().expect("it ends").to_owned()
    };
    let zoes_number = number(&ada.said());
    types(&mut lines, &format!("x {zoes_number}"));
    let end = ends(&zoe);
    assert!(matches!(end, CallEvent::Failed(_)), "{end:?}");
    ada.says("a guest's link is revoked", 1);
    let refused = || {
        let status = hall.client.room_status(&zoes);
        let status = house.runtime.block_on(status);
        matches!(status, Err(link_http::HttpError::Unauthorized { .. }))
    };
    wait_for("the server to take the token back", refused);
    let before = bob.statistics().frames;
    wait_for("Bob to see more", || bob.statistics().frames > before + 30);

    // Another link for the same name is another guest: it pardons nobody.
    types(&mut lines, "g Zoe,1h");
    ada.says("Zoe joins with", 2);
    let again = guests_link(&mut ada, "Zoe");
    assert_ne!(again, zoes, "a link of its own");
    let guest = joins(&hall, &again, 15);
    wait_for("the new guest to see", || guest.statistics().frames > 0);
    wait_for("the old link to be refused still", refused);
}

#[test]
fn a_guests_link_in_an_open_room_is_no_link_to_the_room() {
    let house = House::open();
    let (mut ada, mut lines) = performer(&house, &[]);
    ada.says("Others join with", 1);
    types(&mut lines, "g Bob,10m,see");
    let bobs = guests_link(&mut ada, "Bob");
    let hall = Hall::of(&house);
    // Without what says who he is, what he may have and until when.
    let link = bobs.to_string();
    let (cut, _) = link.split_once(":guest=").expect("a pass");
    let end = ends(&joins(&hall, &cut.parse().expect("a link"), 16));
    assert!(
        matches!(end, CallEvent::Failed(CallError::Refused(Refusal::Link))),
        "{end:?}"
    );
    let bob = joins(&hall, &bobs, 16);
    wait_for("Bob to see", || bob.statistics().frames > 10);
    assert_eq!(bob.statistics().voice, 0, "he may only see");
}

#[test]
fn whoever_the_server_serves_is_known_until_they_leave_and_can_be_sent_away() {
    let house = House::open_with(&["--forward"]);
    let (mut ada, mut lines) = performer(&house, &[]);
    let link = ada.word_after("mon3tr receive ");
    let link: RoomLink = link.parse().expect("a link");
    let hall = Hall::of(&house);
    let viewers = hall.fill(&link, DIRECT);
    // Each with a key.
    let mut served = (0..2).map(|seed| {
        let viewer = joins(&hall, &link, 20 + seed);
        house.server_says("forwarding begins in room", 1);
        assert!(!frames(std::slice::from_ref(&viewer), 30)[0].is_empty());
        viewer
    });
    let (first, second) = (served.next().expect("one"), served.next().expect("one"));
    types(&mut lines, "w");
    ada.says("was handed over to the server", 2);
    // Who has gone is known no longer, though it did not say so to the sender.
    drop(first);
    wait_for("the first to be gone", || {
        let before = count_of(&ada.said(), "was handed over to the server");
        types(&mut lines, "w");
        std::thread::sleep(Duration::from_secs(1));
        count_of(&ada.said(), "was handed over to the server") == before + 1
    });
    let said = ada.said();
    let line = said.lines().rfind(|line| line.contains("was handed over"));
    let number = line
        .and_then(|line| line.split(':').next())
        .expect("a number");
    types(&mut lines, &format!("x {number}"));
    ada.says("is sent away, and does not come in again", 1);
    let end = ends(&second);
    assert!(
        matches!(end, CallEvent::Failed(CallError::Refused(Refusal::Removed))),
        "{end:?}"
    );
    drop(viewers);
}

fn count_of(text: &str, what: &str) -> usize {
    text.matches(what).count()
}
