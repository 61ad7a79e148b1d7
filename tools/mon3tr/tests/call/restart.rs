//! A program of a call is killed in mid-call and comes back.

use crate::house::{
    House, assert_nothing_refused, assert_only_skipped, count, frames_come, joined, longest_gap,
    through,
};
use netlab::Impairment;
use synthetic_person::{Puppet, PuppetSize};

#[test]
fn a_viewer_sees_a_sender_again_that_was_killed_and_came_back() {
    let house = House::open();
    let lab = house.lab(Impairment::default(), Impairment::default());
    let sender = house.sender(&[]);
    let mut receiver = house.receiver(&through(&lab, &sender.viewers), "viewer", &[]);
    receiver.says("joined (session", 1);
    frames_come(&lab);
    sender.program.kill();
    let avatar = house.path("puppet.m3a");
    let again = house.send(&["--room", &sender.own, "--avatar", &avatar]);
    receiver.says("joined (session", 2);
    frames_come(&lab);
    let sent = again.ends();
    let call = receiver.report()["call"].take();
    assert_eq!(count(&sent, "joined"), 1, "the one viewer has come back");
    assert_eq!(count(&call["received"], "sessions"), 2, "{call:#}");
    assert_nothing_refused(&call);
    assert!(
        count(&call, "released") > count(&sent, "captured"),
        "it has shown frames of both senders: {call:#}"
    );
    assert!(longest_gap(&call).is_some(), "and nothing in between");
}

#[test]
fn a_sender_may_come_back_with_another_avatar() {
    let house = House::open();
    let other = house.path("other.m3a");
    Puppet::new(PuppetSize {
        gaussians: 1_500,
        ..PuppetSize::SMALL
    })
    .avatar()
    .save(other.as_ref())
    .expect("another made-up person");
    let lab = house.lab(Impairment::default(), Impairment::default());
    let sender = house.sender(&[]);
    let mut receiver = house.receiver(&through(&lab, &sender.viewers), "viewer", &[]);
    receiver.says("joined (session", 1);
    frames_come(&lab);
    sender.program.kill();
    let mut again = house.send(&["--room", &sender.own, "--avatar", &other]);
    receiver.says("come back with another avatar", 1);
    // The call in which that was learnt, and the one to see them.
    receiver.says("joined (session", 3);
    again.says("a viewer has joined", 2);
    frames_come(&lab);
    let sent = again.ends();
    let report = receiver.report();
    assert_eq!(report["avatar"]["gaussians"], 1_500, "the other is shown");
    let size = std::fs::metadata(&other).expect("it is there").len();
    assert_eq!(count(&report["download"], "bytes"), size, "and was fetched");
    assert!(count(&report["call"], "released") > 0, "and moves");
    assert!(count(&sent, "captured") > 0, "as it was captured");
}

#[test]
fn a_killed_viewer_is_dropped_and_stands_in_no_newcomers_way() {
    let house = House::open();
    let lab = house.lab(Impairment::default(), Impairment::default());
    let mut sender = house.sender(&[]);
    let link = through(&lab, &sender.viewers);
    let victim = joined(&house, &lab, &link, "viewer");
    victim.kill();
    let mut newcomer = house.receiver(&link, "viewer", &[]);
    newcomer.says("joined (session", 1);
    sender.program.says("a viewer has left", 1);
    frames_come(&lab);
    let sent = sender.program.ends();
    let report = newcomer.report();
    assert_eq!(count(&sent, "joined"), 2, "{sent:#}");
    assert_eq!(count(&sent, "viewers"), 1, "the newcomer: {sent:#}");
    let call = &report["call"];
    assert_eq!(count(&call["received"], "sessions"), 1, "{call:#}");
    assert_only_skipped(call, &sent);
    assert_nothing_refused(call);
}

#[test]
fn a_call_outlives_its_server_which_lets_newcomers_in_when_it_is_back() {
    let mut house = House::open();
    let lab = house.lab(Impairment::default(), Impairment::default());
    let mut sender = house.sender(&[]);
    let link = through(&lab, &sender.viewers);
    let receiver = joined(&house, &lab, &link, "viewer");
    house.kill_server();
    sender.program.says("calls go on", 1);
    frames_come(&lab);
    house.start_server();
    sender.program.says("in the room again", 1);
    frames_come(&lab);
    let mut newcomer = house.receiver(&link, "newcomer", &[]);
    newcomer.says("joined (session", 1);
    frames_come(&lab);
    let sent = sender.program.ends();
    let first = receiver.report()["call"].take();
    let second = newcomer.report()["call"].take();
    for call in [&first, &second] {
        assert_eq!(count(&call["received"], "sessions"), 1, "{call:#}");
        assert_only_skipped(call, &sent);
        assert_nothing_refused(call);
    }
    assert_eq!(
        count(&first, "released") + count(&second, "released"),
        count(&sent, "sent"),
        "all that was sent to the two: {sent:#}"
    );
    assert!(
        count(&first, "released") > count(&second, "released"),
        "from before the server's end to after it: {first:#} {second:#}"
    );
}
