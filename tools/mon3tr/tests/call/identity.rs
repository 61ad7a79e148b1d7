//! Who may drive an avatar, and who has the link.

use crate::both_ways::{begin, host};
use crate::command::{Outcome, command};
use crate::house::{House, Program, count};
use identity::Identity;
use link_call::{Authentication, CallError, CallEvent, Credentials, Door, Sender, Viewer};
use link_codec::Codec;
use link_http::Client;
use link_playout::Clock;
use link_protocol::Announcement;
use link_protocol::announcement::{AvatarRef, ChannelMode};
use link_protocol::room_link::ServerUrl;
use link_voice::VoiceQueue;
use spmm3::Avatar;
use std::time::Duration;
use test_support::speech::syllables;

/// The keys of three people, each in a file of its own.
fn key(house: &House, name: &str) -> String {
    house.path(&format!("{name}.key"))
}

/// What `mon3tr keys` says to the one of that name.
fn keys(house: &House, name: &str, arguments: &[&str]) -> Outcome {
    let mut command = command(&[&["keys"], arguments].concat());
    Outcome::of(command.env("MON3TR_KEY", key(house, name)))
}

/// The word that follows these in what was said.
fn word_after(said: &str, words: &str) -> String {
    let rest = said.split_once(words).expect("it is said").1;
    rest.split_whitespace().next().expect("a word").to_owned()
}

fn send_as(house: &House, name: &str) -> Program {
    let (server, avatar) = (
        format!("http://{}", house.address),
        house.avatar.to_str().expect("UTF-8").to_owned(),
    );
    let (token, json) = (house.owner_token(), house.new_report());
    let mut send = command(&["send", "--owner-token", &token, "--json", &json]);
    send.args(["--server", &server, "--avatar", &avatar])
        .env("RUST_LOG", "link=info")
        .env("MON3TR_KEY", key(house, name));
    Program::start_as(house, house.folder.path(), &mut send)
}

#[test]
fn a_signed_avatar_is_driven_by_its_owner_and_whom_they_let() {
    let house = House::open();
    let avatar = house.avatar.to_str().expect("UTF-8").to_owned();
    let signed = keys(&house, "ada", &["sign", &avatar]).succeeds();
    let own = word_after(&keys(&house, "ada", &[]).succeeds(), "its fingerprint");
    assert!(signed.contains(&own), "{signed} {own}");
    let again = keys(&house, "bob", &["sign", &avatar]);
    again.fails_naming(&["sign", &own, "another key"]);

    // Its owner.
    let mut sender = send_as(&house, "ada");
    let link = sender.word_after("mon3tr receive ");
    let mut viewer = house.receiver(&link, "viewer", &[]);
    viewer.says("joined (session", 1);
    let seen = viewer.ends();
    let key_told = word_after(&keys(&house, "ada", &[]).succeeds(), "your key");
    assert_eq!(seen["call"]["received"]["sender"], key_told, "{seen:#}");
    sender.ends();

    // Another one, who is told what to do, and does it.
    let said = send_as(&house, "bob").fails();
    assert!(said.contains("mon3tr keys allow"), "{said}");
    let bobs = word_after(&said, "mon3tr keys allow ");
    let bobs = &bobs[..43];
    let permit = keys(&house, "ada", &["allow", bobs]).succeeds();
    let permit = permit
        .split_once("keys accept ")
        .expect("a permit")
        .1
        .trim();
    keys(&house, "eve", &["accept", permit]).fails_naming(&["the permit is for the key"]);
    keys(&house, "bob", &["accept", permit]).succeeds();
    let mut sender = send_as(&house, "bob");
    let link = sender.word_after("mon3tr receive ");
    let mut viewer = house.receiver(&link, "viewer", &[]);
    viewer.says("joined (session", 1);
    viewer.ends();
    sender.ends();
}

/// What two people with the same link look like to a viewer who has met one of them.
#[test]
fn a_viewer_does_not_go_on_with_someone_else() {
    let house = House::open();
    let mut ada = send_as(&house, "ada");
    let link = ada.word_after("mon3tr receive ");
    let own = ada.word_after("comes back with --room ");
    // The viewers' link pins the key; as others print it, it does not.
    let unpinned = link.split(":key=").next().expect("a link").to_owned();
    let secret = link.split(":secret=").nth(1).expect("a secret");
    let secret = secret.split(':').next().expect("its text");
    let unpinned = match unpinned.contains(":secret=") {
        true => unpinned,
        false => format!("{unpinned}:secret={secret}"),
    };
    let mut viewer = house.receiver(&unpinned, "viewer", &[]);
    viewer.says("joined (session", 1);
    ada.kill();
    let avatar = house.avatar.to_str().expect("UTF-8").to_owned();
    let mut send = command(&["send", "--room", &own, "--avatar", &avatar]);
    send.env("MON3TR_KEY", key(&house, "eve"));
    let _eve = Program::start_as(&house, house.folder.path(), &mut send);
    let said = viewer.fails();
    assert!(said.contains("someone else sends now"), "{said}");
}

/// The thief has the owner's avatar, a server that takes it, and a program that asks for no key.
#[test]
fn viewers_refuse_who_took_an_avatar() {
    let house = House::open();
    let avatar = house.avatar.to_str().expect("UTF-8").to_owned();
    keys(&house, "ada", &["sign", &avatar]).succeeds();
    let loaded = Avatar::load(&house.avatar).expect("the package");
    let thief = Identity::generate().expect("a key");
    for credentials in [None, Some(Credentials::new(thief))] {
        let refused = house.runtime.block_on(async {
            let client = Client::new(None).expect("a client");
            let server: ServerUrl = format!("http://{}", house.address).parse().expect("it");
            let token = house.owner_token();
            let put = client.put_package(&server, &token, &house.avatar, |_, _| {});
            put.await.expect("the package is taken");
            let room = client.open_room(&server, &token, None).await;
            let room = room.expect("a room");
            let announcement = Announcement {
                avatar: AvatarRef::of_file(&house.avatar).expect("the package"),
                channel: ChannelMode::default(),
                codec: Codec::default(),
                rate_hz: 30.0,
            };
            let is_silent = credentials.is_none();
            let sender = Sender::enter(
                client.clone(),
                room.sender,
                announcement,
                credentials,
                Door::default(),
                Clock::start(),
            );
            let sender = sender.await.expect("in the room");
            let authentication = Authentication {
                own: None,
                signer: loaded.signer,
            };
            let (clock, voice) = (Clock::start(), VoiceQueue::default());
            let viewer = Viewer::join(client, room.viewer, authentication, clock, voice);
            let event = tokio::task::spawn_blocking(move || viewer.next(Duration::from_secs(60)));
            let event = event.await.expect("no panic").expect("an event");
            sender.hang_up().await;
            (is_silent, event)
        });
        match refused {
            (true, CallEvent::Failed(CallError::NoKey)) => {}
            (false, CallEvent::Failed(CallError::NotTheirAvatar { .. })) => {}
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn who_opened_a_call_is_missed_where_others_are_there_alone() {
    let house = House::open();
    let host = host(&house);
    let mut ada = begin(&house, "ada", &syllables(1), &host.arguments());
    let link = ada.word_after("mon3tr call ");
    let (before, _) = link.split_once(":secret=").expect("a secret");
    let mut cut = begin(&house, "cut", &syllables(2), &[before]);
    cut.says("this link has no secret", 1);
    cut.ask_to_end();
    let (start, key) = link.split_once(":key=").expect("a key");
    let first = if key.starts_with('a') { "b" } else { "a" };
    let other = format!("{start}:key={first}{}", &key[1..]);
    let mut bob = begin(&house, "bob", &syllables(3), &[&other]);
    bob.says("ada has joined", 1);
    bob.says("careful: nobody who is here is who opened the call", 1);
    // Nobody is told to have joined who does not have the link.
    assert!(!bob.said().contains("cut has joined"), "{}", bob.said());
    ada.ends();
    bob.says("ada has left", 1);
    bob.ends();
}

#[test]
fn who_has_a_part_of_the_link_only_is_told_so_and_sees_nothing() {
    let house = House::open();
    let mut sender = house.sender(&[]);
    let (before, _) = sender.viewers.split_once(":secret=").expect("a secret");
    let said = house.receiver(before, "cut", &[]).fails();
    assert!(said.contains("whole link"), "{said}");
    // Also before anybody is there.
    let warned = said.find("this link has no secret").expect("a warning");
    let refused = said.find("whole link").expect("the refusal");
    assert!(warned < refused, "{said}");
    sender
        .program
        .says("does not prove that it has the link", 1);
    // One letter of the key: someone else is expected.
    let (link, key) = sender.viewers.split_once(":key=").expect("a key");
    let first = if key.starts_with('a') { "b" } else { "a" };
    let other = format!("{link}:key={first}{}", &key[1..]);
    let said = house.receiver(&other, "other", &[]).fails();
    assert!(said.contains("another key"), "{said}");
    let mut viewer = house.receiver(&sender.viewers, "viewer", &[]);
    viewer.says("joined (session", 1);
    viewer.ends();
    let sent = sender.program.ends();
    assert!(count(&sent, "payload_bytes") > 0, "{sent:#}");
}
