//! `mon3tr call` by two real processes: each is seen and heard by the other.

use crate::command::command;
use crate::house::{House, Program, count, number};
use crate::voice::{PIECE, best_likeness, loudness, read_wav, syllables, write_wav};
use serde_json::Value;

/// Begins `call` as one of two people.
fn begin(house: &House, name: &str, voice: &[f32], arguments: &[&str]) -> Program {
    let [said, heard] = ["said", "heard"].map(|what| house.path(&format!("{what}-{name}.wav")));
    write_wav(&said, link_voice::RATE, voice);
    let (avatar, json) = (house.avatar.to_string_lossy(), house.new_report());
    let first = ["call", "--avatar", &avatar, "--json", &json];
    let second = ["--voice", &said, "--sound", &heard, "--display", "none"];
    let mut command = command(&[first.as_slice(), &second, arguments].concat());
    let cache = house.folder.path().join(name);
    Program::start_as(house, &cache, command.env("RUST_LOG", "link=info"))
}

/// How alike what `name` heard is to a voice, piece by piece, the best first.
fn alike(house: &House, name: &str, voice: &[f32]) -> Vec<f32> {
    let heard = loudness(&read_wav(&house.path(&format!("heard-{name}.wav"))));
    let said = loudness(voice);
    let mut alike: Vec<f32> = heard
        .chunks_exact(PIECE)
        .map(|piece| best_likeness(&said, piece))
        .collect();
    alike.sort_by(|a, b| b.total_cmp(a));
    alike
}

fn assert_heard(report: &Value, name: &str) {
    let call = &report["received"]["call"];
    let latency = &call["latency"];
    let (ear, apart) = (&latency["mouth_to_ear"], &latency["voice_apart"]);
    println!("{name} heard after {ear:#}, apart {apart:#}");
    assert!(count(call, "released") > 150, "{name}: {call:#}");
    // `netlab --voice` says how well; here it is only not to be far off.
    assert!(number(ear, "p50_ms") < 500.0, "{name}: {ear:#}");
    assert!(number(apart, "p50_ms") <= 20.0, "{name}: {apart:#}");
    assert!(count(&report["sent"], "sent") > 150, "{name}: {report:#}");
}

#[test]
fn two_people_see_and_hear_each_other_by_one_link() {
    let house = House::open();
    let server = format!("http://{}", house.address);
    let token = house.owner_token();
    let voices = [1, 5].map(syllables);
    let host = [
        "--server",
        &server,
        "--owner-token",
        &token,
        "--seconds",
        "10",
    ];
    let mut ada = begin(&house, "ada", &voices[0], &host);
    let link = ada.word_after("mon3tr call ");
    let mut bob = begin(&house, "bob", &voices[1], &[&link]);
    for person in [&mut ada, &mut bob] {
        person.says("joined (session", 1);
    }
    // The first one hangs up, and so the call is over for both.
    let [ada, bob] = [ada, bob].map(Program::report);
    assert_heard(&ada, "ada");
    assert_heard(&bob, "bob");
    for (name, own, other) in [("ada", 0, 1), ("bob", 1, 0)] {
        let (theirs, mine) = (
            alike(&house, name, &voices[other]),
            alike(&house, name, &voices[own]),
        );
        println!("{name} heard the other {theirs:?}, themselves {mine:?}");
        // What was said while one of them was still joining is left out.
        assert!(theirs.len() >= 3 && theirs[2] > 0.85, "{name}: {theirs:?}");
        assert!(mine[0] < 0.8, "{name} heard themselves: {mine:?}");
    }
}

#[test]
fn a_call_that_no_one_joins_ends_well_and_wrong_links_are_refused_in_one_line() {
    let house = House::open();
    let server = format!("http://{}", house.address);
    let token = house.owner_token();
    let voice = syllables(1);
    let host = ["--server", &server, "--owner-token", &token];
    let mut ada = begin(&house, "ada", &voice, &host);
    let link = ada.word_after("mon3tr call ");
    ada.says("waiting for the sender", 1);
    let report = ada.ends();
    assert!(report["received"].is_null(), "{report:#}");
    assert_eq!(count(&report["sent"], "joined"), 0, "{report:#}");
    // One token is of no use for the other's room, and links of rooms are no links of calls.
    let (rooms, tokens) = link.split_once('#').expect("a link");
    let (viewer, sender) = tokens.split_once(',').expect("two tokens");
    let turned = format!("{rooms}#{sender},{viewer}");
    let said = begin(&house, "eve", &voice, &[&turned]).fails();
    assert!(
        said.lines().filter(|line| line.contains("error")).count() == 1,
        "{said}"
    );
    let said = begin(
        &house,
        "eve",
        &voice,
        &["http://127.0.0.1:1/rooms/r#secret"],
    )
    .fails();
    assert!(said.contains("no call's link"), "{said}");
    assert!(!said.contains("secret"), "a token is told: {said}");
}
