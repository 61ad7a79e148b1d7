//! Several people in one room.

use super::sight::Sight;
use super::viewer::{is_focused, monado, viewer};
use crate::house::{House, Sender, count, number};
use synthetic_person::{Puppet, PuppetSize};
use test_support::monado::Scripted;
use test_support::service::attended;

/// From one to the other, metres, both 1.6 m from the viewer: the first stands on the left.
const APART: f64 = 0.9;

fn spots() -> [[f64; 2]; 2] {
    let half = (APART / 2.0 / super::sight::DISTANCE).asin();
    [-half, half].map(|angle| [angle.sin(), -angle.cos()].map(|x| x * super::sight::DISTANCE))
}

/// What share of the two people's chests is seen in the last picture.
fn seen(house: &House, folder: &str) -> [f64; 2] {
    let sight = Sight::of(house.path(folder), &Scripted::default());
    println!("{folder}: {:?} pixels", sight.pixels());
    spots().map(|spot| sight.at(spot))
}

/// Two rooms' senders, the second one's of a house of its own, whose person has 1,500 Gaussians.
fn senders(first: &House, second: &House) -> [Sender; 2] {
    let other = PuppetSize {
        gaussians: 1_500,
        ..PuppetSize::SMALL
    };
    let saved = Puppet::new(other).avatar().save(&second.avatar);
    saved.expect("another made-up person");
    [first, second].map(|house| house.sender(&[]))
}

#[test]
fn two_people_stand_in_one_room_and_one_stays_when_the_other_leaves() {
    attended(|| {
        let Some((monado, _head)) = monado() else {
            return;
        };
        let (house, second) = (House::open(), House::open());
        let [stays, goes] = senders(&house, &second);
        let links = [stays.viewers.as_str(), goes.viewers.as_str()];
        let together = viewer(&house, &monado, &links, "together", &["--frames", "60"]).report();
        let others = together["others"].as_array().expect("others");
        assert_eq!(others.len(), 1, "{together:#}");
        assert_eq!(count(&together["avatar"], "gaussians"), 2_000, "the first");
        assert_eq!(count(&others[0]["avatar"], "gaussians"), 1_500, "another");
        for call in [&together["call"], &others[0]["call"]] {
            assert!(count(call, "released") > 0, "both move: {call:#}");
        }
        let shares = seen(&house, "together");
        assert!(shares.iter().all(|share| *share > 0.9), "both: {shares:?}");

        let mut alone = viewer(&house, &monado, &links, "alone", &["--frames", "160"]);
        alone.says("joined (session", 2);
        is_focused(&mut alone, 1);
        goes.program.ends();
        alone.says("person 1 has left", 1);
        let report = alone.report();
        let shares = seen(&house, "alone");
        assert!(shares[0] > 0.9 && shares[1] < 0.1, "the first: {shares:?}");
        let call = &report["call"];
        let (whole, live) = (number(call, "seconds"), number(call, "live_seconds"));
        assert!(live > 0.5 * whole, "they stayed: {live} of {whole} s");
        assert_eq!(report["others"][0]["avatar"]["gaussians"], 1_500, "told of");
    });
}

#[test]
fn one_persons_failed_call_is_told_and_the_others_go_on_to_a_good_end() {
    attended(|| {
        let Some((monado, _head)) = monado() else {
            return;
        };
        let (house, mut second) = (House::open(), House::open());
        let [stays, goes] = senders(&house, &second);
        let links = [stays.viewers.as_str(), goes.viewers.as_str()];
        let mut viewer = viewer(&house, &monado, &links, "viewer", &[]);
        viewer.says("joined (session", 2);
        is_focused(&mut viewer, 1);
        // Their server comes back as another one, which knows no such room.
        goes.program.kill();
        second.kill_server();
        std::fs::remove_dir_all(second.path("server")).expect("the server's data");
        second.start_server();
        viewer.says("person 1 has left", 1);
        assert!(viewer.is_running(), "somebody stays:\n{}", viewer.said());
        viewer.ask_to_end();
        let (report, said) = viewer.report_and_said();
        assert!(said.contains("person 1's call ended: "), "told:\n{said}");
        let call = &report["call"];
        assert!(count(call, "released") > 0, "the first one's: {call:#}");
        assert_eq!(report["others"][0]["avatar"]["gaussians"], 1_500, "told of");
    });
}

#[test]
fn the_last_persons_failed_call_fails_the_command() {
    attended(|| {
        let Some((monado, _head)) = monado() else {
            return;
        };
        let mut house = House::open();
        let goes = house.sender(&[]);
        let mut viewer = viewer(&house, &monado, &[&goes.viewers], "viewer", &[]);
        viewer.says("joined (session", 1);
        is_focused(&mut viewer, 1);
        goes.program.kill();
        house.kill_server();
        std::fs::remove_dir_all(house.path("server")).expect("the server's data");
        house.start_server();
        let said = viewer.fails();
        let line = said.lines().find(|line| line.starts_with("error: "));
        assert!(
            line.is_some_and(|line| line.contains("the call ended")),
            "{said}"
        );
    });
}
