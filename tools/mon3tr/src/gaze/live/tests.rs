use super::super::sample::LineOfSight;
use super::*;
use app_session::headset::{GazeListener, WearerView};
use call_member::GazeFeed;
use glam::{Affine3A, Vec3};
use std::io::Cursor;
use std::net::Ipv4Addr;

const HERE: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// What came of these lines, and how many were none.
fn came_of(lines: &[u8]) -> (Option<Sample>, [u64; 3]) {
    let live = Live(Arc::default());
    follow(Cursor::new(lines), &Arc::downgrade(&live.0));
    (live.at(Instant::now()), live.counts())
}

fn at(x: f32, y: f32) -> Option<Sample> {
    Some(Sample::At([x, y]))
}

/// Waits until so many lines have come, taken or not.
fn wait_for(live: &Live, lines: u64) {
    let begun = Instant::now();
    while live.counts().iter().sum::<u64>() < lines {
        assert!(begun.elapsed().as_secs() < 20, "{:?}", live.counts());
        thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn lines_are_taken_as_they_come_and_what_is_none_is_passed_over() {
    let lines = b"seconds,x,y\n# a tracker's\n5,0.1,0.2\nrubbish\n6,0.3,0.4\n7,,\n";
    assert_eq!(came_of(lines), (at(0.3, 0.4), [2, 1, 0]), "the newest");
    let unended = b"0,0.5,0.25";
    assert_eq!(
        came_of(unended),
        (at(0.5, 0.25), [1, 0, 0]),
        "without an end"
    );
    assert_eq!(came_of(b""), (None, [0, 0, 0]), "nothing");
}

#[test]
fn a_line_without_end_is_one_line_that_is_none() {
    // Its end would be a sample of its own.
    let mut lines = vec![b'9'; 10 * LONGEST];
    lines.extend(b"9,0.9,0.9\n1,0.5,0.25\n");
    assert_eq!(came_of(&lines), (at(0.5, 0.25), [1, 1, 0]));
    // As long as it may be.
    let mut lines = format!("{:<width$}", "1,0.5,0.25", width = LONGEST - 1).into_bytes();
    lines.push(b'\n');
    assert_eq!(came_of(&lines), (at(0.5, 0.25), [1, 0, 0]));
}

#[test]
fn a_gaze_holds_for_a_blink_and_a_view_for_a_stumble() {
    let view = LineOfSight {
        eye: Vec3::Y,
        direction: Vec3::Z,
    };
    for (sample, ms) in [(Sample::At([0.5; 2]), 400), (Sample::From(view), 2_000)] {
        let live = Live(Arc::default());
        let came = Instant::now();
        *live.0.lock() = Some((came, sample));
        let later = |ms| live.at(came + Duration::from_millis(ms));
        assert_eq!([later(0), later(ms)], [Some(sample); 2], "held");
        assert_eq!(later(ms + 1), None, "no longer");
    }
}

#[test]
fn a_sample_that_is_late_or_anothers_is_not_taken_and_who_falls_silent_makes_room() {
    let [headset, other] = [1, 2].map(|port| SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
    let zero = Instant::now();
    let mut followed = Followed::default();
    let mut admit =
        |from, seconds, ms| followed.admit(from, seconds, zero + Duration::from_millis(ms));
    assert_eq!(admit(headset, 7.0, 0), Ok(()), "the first");
    assert_eq!(admit(headset, 6.9, 10), Err(headset), "late");
    assert_eq!(admit(headset, 7.0, 10), Err(headset), "twice");
    assert_eq!(admit(other, 100.0, 10), Err(headset), "another's");
    assert_eq!(admit(headset, 7.1, 300), Ok(()), "the next");
    assert_eq!(
        admit(other, 100.0, 700),
        Err(headset),
        "within a blink of it"
    );
    assert_eq!(admit(other, 1.0, 701), Ok(()), "after it, by its own clock");
    assert_eq!(admit(headset, 8.0, 702), Err(other), "it has the place now");
    assert_eq!(admit(other, 0.5, 1_200), Ok(()), "started again");
}

#[test]
fn a_headsets_datagrams_are_taken_and_those_of_others_are_counted() {
    let (live, address) = Live::udp(HERE).expect("a port");
    let headset = GazeFeed::new(address).expect("a way");
    let other = UdpSocket::bind(HERE).expect("a port");
    let tell = || {
        headset.looked(&WearerView {
            floor_from_head: Affine3A::from_translation(Vec3::new(0.5, 1.6, 0.0)),
            gazes: [None; 2],
            floor_from_person: Affine3A::from_translation(Vec3::new(0.0, 0.0, -2.0)),
        });
    };
    tell();
    wait_for(&live, 1);
    let Some(Sample::From(sight)) = live.at(Instant::now()) else {
        panic!("no line of sight");
    };
    let eye = Vec3::new(0.5, 1.6, 2.0);
    assert!(sight.eye.abs_diff_eq(eye, 1e-3), "{sight:?}");
    assert!(sight.direction.abs_diff_eq(Vec3::NEG_Z, 1e-3), "{sight:?}");
    // What is no gaze is told of, whoever sends it; a heading is not.
    for line in ["8".repeat(2 * LONGEST).as_str(), "seconds,x,y", "?"] {
        other.send_to(line.as_bytes(), address).expect("sent");
    }
    wait_for(&live, 3);
    assert_eq!(live.counts(), [1, 2, 0]);
    for second in 1..=50 {
        tell();
        let line = format!("{second},0.2,0.2");
        other.send_to(line.as_bytes(), address).expect("sent");
    }
    wait_for(&live, 103);
    let [taken, refused, passed_over] = live.counts();
    // On a machine that sleeps for a blink between two of them the other one gets in.
    assert!(refused == 2 && passed_over >= 40, "{:?}", live.counts());
    assert!(taken + passed_over == 101, "{:?}", live.counts());
}

#[test]
fn an_address_that_is_taken_is_named_and_free_again_afterwards() {
    let (live, address) = Live::udp(HERE).expect("a port");
    let why = Live::udp(address).expect_err("it is taken");
    assert!(format!("{why:#}").contains(&address.to_string()), "{why:#}");
    drop(live);
    let begun = Instant::now();
    while Live::udp(address).is_err() {
        assert!(begun.elapsed().as_secs() < 20, "never free");
        thread::sleep(Duration::from_millis(20));
    }
}
