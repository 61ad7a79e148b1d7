//! The network goes away in mid-call and comes back.

use crate::house::{House, assert_nothing_refused, count, frames_come, longest_gap, through};
use netlab::Impairment;
use serde_json::Value;
use std::time::Duration;

/// A call through an outage; returns what the receiver says of it.
fn call_through(outage: Duration, arguments: &[&str]) -> Value {
    let house = House::open();
    let lab = house.lab(Impairment::default(), Impairment::default());
    let mut sender = house.sender(arguments);
    let receiver = house.receiver(&through(&lab, &sender.viewers), "viewer", &[]);
    sender.program.says("a viewer has joined", 1);
    frames_come(&lab);
    lab.cut(outage);
    std::thread::sleep(outage);
    frames_come(&lab);
    let sent = sender.program.ends();
    let call = receiver.report()["call"].take();
    assert_nothing_refused(&call);
    // The viewer may have given one up that the sender thought was made.
    assert!(
        count(&sent, "joined") >= count(&call["received"], "sessions"),
        "the viewer knows of no connection that the sender does not: {sent:#} {call:#}"
    );
    let gap = longest_gap(&call).expect("a gap, and a frame after it");
    assert!(
        gap >= outage.as_secs_f64() * 1e3 - 250.0,
        "an outage of {outage:?} makes a gap as long: {gap} ms"
    );
    call
}

#[test]
fn a_call_goes_on_by_itself_after_3_s_without_network() {
    for channel in ["unreliable", "reliable"] {
        call_through(Duration::from_secs(3), &["--channel", channel]);
    }
}

#[test]
fn a_call_goes_on_by_itself_after_10_s_without_network() {
    let call = call_through(Duration::from_secs(10), &[]);
    let sessions = count(&call["received"], "sessions");
    assert!(
        sessions > 1,
        "a connection that was dead for 10 s is made anew"
    );
}

#[test]
fn a_reliable_call_goes_on_by_itself_after_10_s_without_network() {
    let paper = ["--channel", "reliable", "--codec", "paper"];
    let call = call_through(Duration::from_secs(10), &paper);
    let sessions = count(&call["received"], "sessions");
    assert!(
        sessions > 1,
        "a connection that was dead for 10 s is made anew"
    );
}
