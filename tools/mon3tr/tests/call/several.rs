//! A call of several: people come and go, mute and hide themselves, and come back as they were.

use crate::both_ways::{begin, begin_steered, host};
use crate::house::{House, Program, count};
use crate::voice::read_wav;
use std::io::Write;
use std::process::ChildStdin;
use test_support::speech::{PIECE, best_likeness, loudness_at, sung, syllables};

fn press(stdin: &mut ChildStdin, key: &str) {
    writeln!(stdin, "{key}").expect("it listens");
    stdin.flush().expect("it listens");
}

#[test]
fn three_people_talk_mute_hide_and_leave_one_by_one() {
    let house = House::open();
    let pitches = [400.0, 700.0, 1100.0];
    let voices = [1, 5, 9]
        .iter()
        .zip(pitches)
        .map(|(voice, pitch)| sung(*voice, pitch));
    let voices: Vec<Vec<f32>> = voices.collect();
    let host = host(&house);
    let (mut ada, mut keys) = begin_steered(&house, "ada", &voices[0], &host.arguments());
    let link = ada.word_after("mon3tr call ");
    let mut bob = begin(&house, "bob", &voices[1], &[&link]);
    ada.says("bob has joined", 1);
    let mut eve = begin(&house, "eve", &voices[2], &[&link]);
    for person in [&mut ada, &mut bob] {
        person.says("eve has joined", 1);
        person.says("joined (session", 2);
    }
    eve.says("joined (session", 2);
    // Long enough for a few of the pieces that are compared.
    std::thread::sleep(std::time::Duration::from_secs(8));
    press(&mut keys, "w");
    ada.says("in the call: you; ", 1);
    press(&mut keys, "m");
    ada.says("you are muted", 1);
    press(&mut keys, "h");
    for person in [&mut bob, &mut eve] {
        person.says("ada is muted", 1);
        person.says("ada is hidden", 1);
    }
    // Whoever is hidden says nothing of their motion, and is not taken for lost.
    std::thread::sleep(std::time::Duration::from_secs(3));
    press(&mut keys, "m");
    press(&mut keys, "h");
    for person in [&mut bob, &mut eve] {
        person.says("ada is no longer muted", 1);
        person.says("ada is seen again", 1);
    }
    assert!(!bob.said().contains("connecting again"), "{}", bob.said());
    let eve = eve.ends();
    for person in [&mut ada, &mut bob] {
        person.says("eve has left", 1);
        assert!(person.is_running(), "the call goes on");
    }
    press(&mut keys, "q");
    let ada = ada.report();
    bob.says("ada has left", 1);
    let bob = bob.ends();
    for (report, name) in [(&ada, "ada"), (&bob, "bob"), (&eve, "eve")] {
        let received = &report["received"];
        let others = received["others"].as_array().map_or(0, Vec::len);
        assert_eq!(others, 1, "{name}: {received:#}");
        for call in [&received["call"], &received["others"][0]["call"]] {
            assert!(count(call, "released") > 150, "{name}: {call:#}");
        }
    }
    // Everyone heard both of the others together, each at their own pitch, for a whole piece at least (one was muted for a while), and not themselves.
    for (name, own) in [("ada", 0), ("bob", 1), ("eve", 2)] {
        let heard = read_wav(&house.path(&format!("heard-{name}.wav")));
        let loudest =
            pitches.map(|pitch| loudness_at(&heard, pitch).into_iter().fold(0.0, f32::max));
        for other in (0..3).filter(|other| *other != own) {
            let pitch = pitches[other];
            let [said, heard] = [&voices[other], &heard].map(|voice| loudness_at(voice, pitch));
            let mut alike: Vec<f32> = (heard.chunks_exact(PIECE))
                .map(|piece| best_likeness(&said, piece))
                .collect();
            alike.sort_by(|a, b| b.total_cmp(a));
            println!("{name} heard voice {other}: {alike:?}, as loud as {loudest:?}");
            assert!(
                alike[0] > 0.9,
                "{name} did not hear voice {other}: {alike:?}"
            );
            assert!(
                loudest[other] > 10.0 * loudest[own],
                "{name} heard themselves: {loudest:?}"
            );
        }
    }
}

#[test]
fn an_avatar_and_a_name_are_remembered() {
    let house = House::open();
    let voice = syllables(1);
    let host = host(&house);
    let mut first = begin(&house, "ada", &voice, &host.arguments());
    first.says("you are in the call", 1);
    first.ends();
    let again = [&["call", "--display", "none"][..], &host.arguments()].concat();
    let cache = house.folder.path().join("ada");
    let mut ada = Program::start_as(
        &house,
        &cache,
        crate::command::command(&again).env("RUST_LOG", "link=info"),
    );
    let link = ada.word_after("mon3tr call ");
    let mut bob = begin(&house, "bob", &voice, &[&link]);
    bob.says("ada has joined", 1);
    ada.says("bob has joined", 1);
    bob.ends();
    ada.says("bob has left", 1);
    ada.ask_to_end();
}

#[test]
fn whoever_is_killed_leaves_and_a_full_call_says_so() {
    let house = House::open();
    let voice = syllables(1);
    let host = host(&house);
    // All come from one address.
    let arguments = [&host.arguments()[..], &["--seats-per-address", "8"]].concat();
    let mut ada = begin(&house, "ada", &voice, &arguments);
    let link = ada.word_after("mon3tr call ");
    let others: Vec<Program> = (1..8)
        .map(|number| {
            let name = format!("guest {number}");
            let mut guest = begin(&house, &name, &voice, &[&link]);
            guest.says("you are in the call", 1);
            guest
        })
        .collect();
    for number in 1..8 {
        ada.says(&format!("guest {number} has joined"), 1);
    }
    let said = begin(&house, "late", &voice, &[&link]).fails();
    assert!(said.contains("the call is full"), "{said}");
    let mut others = others.into_iter();
    others.next().expect("there are seven").kill();
    ada.says("guest 1 has left", 1);
    let mut late = begin(&house, "late", &voice, &[&link]);
    late.says("you are in the call", 1);
    ada.says("late has joined", 1);
    late.ends();
    drop(others);
    ada.ends();
}
