//! Who gets in, and how a call ends.

use crate::command::{Outcome, command};
use crate::house::{
    House, assert_nothing_refused, assert_only_skipped, count, frames_come, joined, through,
};
use link_http::Client;
use link_protocol::RoomLink;
use link_protocol::room_link::ServerUrl;
use netlab::{Impairment, Loss, Probability};
use std::time::{Duration, SystemTime};

#[test]
fn one_viewers_bad_network_costs_the_other_nothing() {
    let house = House::open();
    let bad = Impairment {
        loss: Loss::Independent(Probability::new(0.1).expect("a share")),
        delay: Duration::from_millis(50),
        ..Impairment::default()
    };
    let clean = house.lab(Impairment::default(), Impairment::default());
    let bad = house.lab(bad.clone(), bad);
    let sender = house.sender(&[]);
    let mut well = house.receiver(&through(&clean, &sender.viewers), "well", &[]);
    let mut ill = house.receiver(&through(&bad, &sender.viewers), "ill", &[]);
    for viewer in [&mut well, &mut ill] {
        viewer.says("joined (session", 1);
    }
    frames_come(&clean);
    frames_come(&bad);
    let sent = sender.program.ends();
    let (well, ill) = (well.report(), ill.report());
    assert_eq!(count(&sent, "joined"), 2, "{sent:#}");
    let (well, ill) = (&well["call"], &ill["call"]);
    assert_only_skipped(well, &sent);
    assert!(count(ill, "lost") > 0, "{ill:#}");
    for call in [well, ill] {
        assert_nothing_refused(call);
        assert_eq!(count(&call["received"], "sessions"), 1, "{call:#}");
    }
}

#[test]
fn a_viewer_who_hangs_up_is_gone_at_once_and_the_sender_goes_on() {
    let house = House::open();
    let lab = house.lab(Impairment::default(), Impairment::default());
    let mut sender = house.sender(&[]);
    let link = through(&lab, &sender.viewers);
    let receiver = joined(&house, &lab, &link, "viewer");
    let seen = receiver.ends();
    assert!(count(&seen["call"], "released") > 0, "{seen:#}");
    sender.program.says("it hung up", 1);
    assert!(sender.program.is_running(), "others may come");
    // One who leaves when its own time is up.
    let limited = house
        .receiver(&link, "viewer", &["--seconds", "2"])
        .report();
    assert!(count(&limited["call"], "released") > 0, "{limited:#}");
    sender.program.says("it hung up", 2);
    let sent = sender.program.ends();
    assert_eq!(count(&sent, "viewers"), 0, "{sent:#}");
    assert_eq!(count(&sent, "joined"), 2, "{sent:#}");
}

#[test]
fn a_sender_who_hangs_up_ends_the_call_for_all_viewers() {
    let house = House::open();
    let lab = house.lab(Impairment::default(), Impairment::default());
    let mut sender = house.sender(&[]);
    let link = through(&lab, &sender.viewers);
    let receivers = ["one", "two"].map(|name| house.receiver(&link, name, &[]));
    sender.program.says("a viewer has joined", 2);
    frames_come(&lab);
    let sent = sender.program.ends();
    let shown = receivers.map(|receiver| count(&receiver.report()["call"], "released"));
    assert_eq!(count(&sent, "viewers"), 2, "to the end: {sent:#}");
    assert_eq!(
        shown[0] + shown[1],
        count(&sent, "sent"),
        "to the last frame: {shown:?}, {sent:#}"
    );
}

#[test]
fn a_viewer_may_be_there_before_the_sender() {
    let house = House::open();
    let (sender, viewer) = room(&house, None);
    let mut receiver = house.receiver(&viewer.to_string(), "viewer", &[]);
    receiver.says("waiting for the sender", 1);
    let avatar = house.path("puppet.m3a");
    let link = sender.to_string();
    let sender = house.send(&["--room", &link, "--avatar", &avatar, "--seconds", "1"]);
    let sent = sender.report();
    let call = receiver.report()["call"].take();
    assert_eq!(
        count(&call, "released"),
        count(&sent, "captured"),
        "a performance begins when somebody is there: {call:#}"
    );
}

#[test]
fn the_avatar_is_fetched_once() {
    let house = House::open();
    let lab = house.lab(Impairment::default(), Impairment::default());
    let sender = house.sender(&[]);
    let link = through(&lab, &sender.viewers);
    let size = std::fs::metadata(&house.avatar).expect("it is there").len();
    let sent = || house.metric("mon3tr_package_bytes_sent_total");
    let mut expected = 0;
    // The last one has another cache.
    for (cache, fetched) in [("viewer", size), ("viewer", 0), ("other", size)] {
        let report = house.receiver(&link, cache, &["--seconds", "1"]).report();
        assert_eq!(count(&report["download"], "bytes"), fetched, "{cache}");
        expected += fetched;
        assert_eq!(sent(), expected, "as the server counts, {cache}");
    }
    let uploaded = house.metric("mon3tr_packages_stored_total");
    assert_eq!(uploaded, 1, "and put into the store once");
    // Nor does a second room put it there again.
    let second = house.sender(&[]);
    assert_eq!(house.metric("mon3tr_packages_stored_total"), uploaded, "2");
    drop(second);
}

#[test]
fn links_that_open_nothing_are_refused_in_one_line() {
    let house = House::open();
    let sender = house.sender(&[]);
    let receive = |link: &str| {
        let cache = house.path("viewer");
        let arguments = ["receive", link, "--display", "none", "--seconds", "60"];
        Outcome::of(command(&arguments).env("MON3TR_CACHE", cache))
    };
    let (room, token) = sender.viewers.split_once('#').expect("a link has a token");
    // What follows the token proves nothing to the server.
    let (genuine, rest) = token.split_once(':').expect("more than a token");
    let last = if genuine.ends_with('A') { 'B' } else { 'A' };
    let forged = format!("{room}#{}{last}:{rest}", &genuine[..genuine.len() - 1]);
    receive(&forged).fails_naming(&["cannot join the room", "does not accept this token"]);
    let elsewhere = format!(
        "http://{}/rooms/AAAAAAAAAAAAAAAAAAAAAA#{token}",
        house.address
    );
    receive(&elsewhere).fails_naming(&["cannot join the room", "ask for a new link"]);
    receive(&sender.own).fails_naming(&["ask for a new link"]);
    let (_, expired) = self::room(&house, Some(Duration::from_secs(1)));
    receive(&expired.to_string()).fails_naming(&["does not accept this token", "expired"]);
    // Nor does a viewer's link let anybody send.
    let avatar = house.path("puppet.m3a");
    let arguments = ["send", "--room", &sender.viewers, "--avatar", &avatar];
    Outcome::of(&mut command(&arguments)).fails_naming(&["cannot enter the room"]);
    // Without the server's address or the token it is no link at all.
    for no_link in [room, "somewhere", "ftp://host/rooms/a#b"] {
        let arguments = ["receive", no_link];
        let outcome = test_support::service::finish(&mut command(&arguments));
        let said = String::from_utf8_lossy(&outcome.stderr).into_owned();
        assert!(
            !outcome.status.success() && said.contains("no room link"),
            "{no_link}: {said}"
        );
    }
}

/// Opens a room; one with a lifetime has expired when this returns.
fn room(house: &House, lifetime: Option<Duration>) -> (RoomLink, RoomLink) {
    let server: ServerUrl = format!("http://{}", house.address).parse().expect("a URL");
    let client = Client::new(None).expect("a client");
    let token = house.owner_token();
    let opening = client.open_room(&server, &token, lifetime);
    let room = house.runtime.block_on(opening).expect("a room");
    if lifetime.is_some() {
        crate::house::wait_for("the room's end", || {
            (SystemTime::now() > room.expires).then_some(())
        });
    }
    (room.sender, room.viewer)
}
