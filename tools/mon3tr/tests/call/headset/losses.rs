//! The runtime goes away in mid-call: the call does not.

use super::sight::{DISTANCE, Sight};
use super::viewer::{is_focused, monado, turned, viewer, words};
use crate::house::{
    House, assert_nothing_refused, assert_only_skipped, count, frames_come, longest_gap, number,
    through,
};
use netlab::{Impairment, Lab};
use serde_json::Value;
use std::thread::sleep;
use std::time::{Duration, Instant};
use test_support::monado::Scripted;
use test_support::service::attended;

/// How long there is no runtime.
const AWAY: Duration = Duration::from_secs(4);

fn lab(house: &House) -> Lab {
    house.lab(Impairment::default(), Impairment::default())
}

/// That the network's side of a call knows nothing of a headset that was `away`.
fn assert_never_dropped(house: &House, report: &Value, sent: &Value, away: Duration) {
    let call = &report["call"];
    assert_eq!(count(sent, "joined"), 1, "joined once: {sent:#}");
    assert_eq!(count(&call["received"], "sessions"), 1, "{call:#}");
    assert_only_skipped(call, sent);
    assert_nothing_refused(call);
    // A machine may be busy for a moment; that is not the headset's being away.
    let longest = longest_gap(call).unwrap_or(0.0);
    assert!(
        longest < away.as_secs_f64() * 500.0,
        "nothing came for {longest} ms: {call:#}"
    );
    let size = std::fs::metadata(&house.avatar).expect("it is there").len();
    let fetched = count(&report["download"], "bytes");
    assert_eq!(fetched, size, "the package was fetched");
    let served = house.metric("mon3tr_package_bytes_sent_total");
    assert_eq!(served, size, "once");
}

#[test]
fn a_call_goes_on_without_a_gap_while_its_headsets_runtime_is_killed_and_comes_back() {
    attended(|| {
        let Some((mut monado, head)) = monado() else {
            return;
        };
        let house = House::open();
        let lab = lab(&house);
        let sender = house.sender(&[]);
        let link = through(&lab, &sender.viewers);
        let mut viewer = viewer(&house, &monado, &[&link], "viewer", &["--frames", "240"]);
        is_focused(&mut viewer, 1);
        frames_come(&lab);
        let threads = viewer.threads();
        drop(head);
        let gone = Instant::now();
        monado.kill();
        viewer.says("the call goes on and waits for it", 1);
        viewer.says("not yet: the OpenXR runtime does not answer", 1);
        frames_come(&lab);
        sleep(AWAY.saturating_sub(gone.elapsed()));
        monado.restart();
        let mut head = monado.head();
        head.send(&turned());
        is_focused(&mut viewer, 2);
        let away = gone.elapsed();
        // The device that went with the runtime is not held: its driver's threads are gone.
        let now = viewer.threads();
        assert!(now <= threads, "{now} threads, {threads} before");
        // It ends by itself: all its frames were shown.
        let report = viewer.report();
        let sent = sender.program.ends();

        let headset = &report["headset"];
        assert_eq!(count(headset, "opened"), 2, "{headset:#}");
        assert_eq!(count(&headset["frames"], "shown"), 240, "{headset:#}");
        let states = words(&headset["states"]);
        let to_focus = ["idle", "ready", "synchronized", "visible", "focused"];
        assert_eq!(states[..5], to_focus, "the first session");
        assert_eq!(states[5..10], to_focus, "the second one: {states:?}");
        assert_eq!(states.last(), Some(&"exiting"), "to a clean end");
        assert_never_dropped(&house, &report, &sent, away);
        // The last picture is of the new runtime's head, and they stand where they stood.
        let folder = house.path("viewer");
        Sight::of(&folder, &turned()).assert_stands_alone([0.0, -DISTANCE]);
    });
}

#[test]
fn a_runtime_that_stands_still_for_three_seconds_is_waited_for_in_the_same_session() {
    attended(|| {
        let Some((monado, _head)) = monado() else {
            return;
        };
        let house = House::open();
        let lab = lab(&house);
        let sender = house.sender(&[]);
        let link = through(&lab, &sender.viewers);
        let mut viewer = viewer(&house, &monado, &[&link], "viewer", &["--frames", "200"]);
        is_focused(&mut viewer, 1);
        frames_come(&lab);
        let still = Duration::from_secs(3);
        monado.pause();
        sleep(still);
        monado.go_on();
        let report = viewer.report();
        let sent = sender.program.ends();

        let headset = &report["headset"];
        assert_eq!(count(headset, "opened"), 1, "{headset:#}");
        let frames = &headset["frames"];
        assert_eq!(count(frames, "shown"), 200, "{headset:#}");
        let longest = number(&frames["interval"], "max_ms");
        assert!(
            longest > 2500.0,
            "it stood still in mid-session: {frames:#}"
        );
        assert_eq!(
            words(&headset["states"]).last(),
            Some(&"exiting"),
            "the end"
        );
        assert_never_dropped(&house, &report, &sent, still);
        let folder = house.path("viewer");
        Sight::of(&folder, &Scripted::default()).assert_stands_alone([0.0, -DISTANCE]);
    });
}
