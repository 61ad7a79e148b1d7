//! `mon3tr call` by two real processes: each is seen and heard by the other.

use crate::command::command;
use crate::house::{House, Program, count, number};
use crate::voice::{read_wav, write_wav};
use serde_json::Value;
use std::path::PathBuf;
use std::process::ChildStdin;
use test_support::speech::{PIECE, best_likeness, loudness, syllables};

/// How the first one in opens the call.
pub(crate) struct Host {
    server: String,
    token: String,
}

pub(crate) fn host(house: &House) -> Host {
    Host {
        server: format!("http://{}", house.address),
        token: house.owner_token(),
    }
}

impl Host {
    pub(crate) fn arguments(&self) -> [&str; 4] {
        ["--server", &self.server, "--owner-token", &self.token]
    }
}

/// Begins `call` as `name`.
pub(crate) fn begin(house: &House, name: &str, voice: &[f32], arguments: &[&str]) -> Program {
    let (cache, arguments) = prepare(house, name, voice, arguments);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut command = command(&arguments);
    Program::start_as(house, &cache, command.env("RUST_LOG", "link=info"))
}

/// The same, steered by its standard input.
pub(crate) fn begin_steered(
    house: &House,
    name: &str,
    voice: &[f32],
    arguments: &[&str],
) -> (Program, ChildStdin) {
    let (cache, arguments) = prepare(house, name, voice, arguments);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut command = command(&arguments);
    Program::start_steered(house, &cache, command.env("RUST_LOG", "link=info"))
}

/// The folder of what `name` keeps, and the arguments of their call, which says `voice` and writes what is heard.
pub(crate) fn prepare(
    house: &House,
    name: &str,
    voice: &[f32],
    arguments: &[&str],
) -> (PathBuf, Vec<String>) {
    let [said, heard] = ["said", "heard"].map(|what| house.path(&format!("{what}-{name}.wav")));
    write_wav(&said, link_voice::RATE, voice);
    let (avatar, json) = (house.avatar.to_string_lossy(), house.new_report());
    let first = ["call", "--name", name, "--avatar", &avatar, "--json", &json];
    let second = ["--voice", &said, "--sound", &heard];
    let display = if arguments.contains(&"--display") {
        &[][..]
    } else {
        &["--display", "none"]
    };
    let all = [first.as_slice(), &second, display, arguments].concat();
    let cache = house.folder.path().join(name);
    (cache, all.into_iter().map(str::to_owned).collect())
}

/// How alike what `name` heard is to a voice, piece by piece, the best first.
pub(crate) fn alike(house: &House, name: &str, voice: &[f32]) -> Vec<f32> {
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
    let voices = [1, 5].map(syllables);
    let host = host(&house);
    let mut ada = begin(
        &house,
        "ada",
        &voices[0],
        &[&host.arguments()[..], &["--seconds", "10"]].concat(),
    );
    let link = ada.word_after("mon3tr call ");
    let mut bob = begin(&house, "bob", &voices[1], &[&link]);
    for (person, other) in [(&mut ada, "bob has joined"), (&mut bob, "ada has joined")] {
        person.says("joined (session", 1);
        person.says(other, 1);
    }
    // The first one hangs up; the other one is told, and stays until they do, too.
    let ada = ada.report();
    bob.says("ada has left", 1);
    let bob = bob.ends();
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
    let voice = syllables(1);
    let host = host(&house);
    let mut ada = begin(&house, "ada", &voice, &host.arguments());
    let link = ada.word_after("mon3tr call ");
    ada.says("you are in the call", 1);
    let report = ada.ends();
    assert!(report["received"].is_null(), "{report:#}");
    assert_eq!(count(&report["sent"], "joined"), 0, "{report:#}");
    // A token of another call is of no use for this one, and links of rooms are no links of calls.
    let other = begin(&house, "ada", &voice, &host.arguments()).word_after("mon3tr call ");
    let [(call, _), (_, token)] = [&link, &other].map(|link| link.split_once('#').expect("a link"));
    let said = begin(&house, "eve", &voice, &[&format!("{call}#{token}")]).fails();
    assert!(
        said.lines().filter(|line| line.contains("error")).count() == 1,
        "{said}"
    );
    assert!(!said.contains(token), "a token is told: {said}");
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
