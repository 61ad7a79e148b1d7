use super::super::sample::View;
use super::*;
use glam::Vec3;
use std::io::Cursor;
use std::net::Ipv4Addr;

const HERE: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// What came of these lines, and how many were none.
fn came_of(lines: &[u8]) -> (Option<Sample>, [u64; 2]) {
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
    assert_eq!(came_of(lines), (at(0.3, 0.4), [2, 1]), "the newest");
    let unended = b"0,0.5,0.25";
    assert_eq!(came_of(unended), (at(0.5, 0.25), [1, 0]), "without an end");
    assert_eq!(came_of(b""), (None, [0, 0]), "nothing");
}

#[test]
fn a_line_without_end_is_one_line_that_is_none() {
    // Its end would be a sample of its own.
    let mut lines = vec![b'9'; 10 * LONGEST];
    lines.extend(b"9,0.9,0.9\n1,0.5,0.25\n");
    assert_eq!(came_of(&lines), (at(0.5, 0.25), [1, 1]));
    // As long as it may be.
    let mut lines = format!("{:<width$}", "1,0.5,0.25", width = LONGEST - 1).into_bytes();
    lines.push(b'\n');
    assert_eq!(came_of(&lines), (at(0.5, 0.25), [1, 0]));
}

#[test]
fn a_gaze_holds_for_a_blink_and_a_view_for_a_stumble() {
    let view = View {
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
fn a_headsets_datagrams_are_taken_in_their_order_and_of_one_sender_at_a_time() {
    let (live, address) = Live::udp(HERE).expect("a port");
    let sender = || UdpSocket::bind(HERE).expect("a port");
    let (headset, other) = (sender(), sender());
    let send = |from: &UdpSocket, line: &str| {
        from.send_to(line.as_bytes(), address).expect("sent");
    };
    send(
        &headset,
        "{\"seconds\":7,\"eye\":[0,1.6,2],\"towards\":[0,1.6,1]}",
    );
    wait_for(&live, 1);
    let view = Some(Sample::From(View {
        eye: Vec3::new(0.0, 1.6, 2.0),
        direction: Vec3::NEG_Z,
    }));
    assert_eq!(live.at(Instant::now()), view);
    // Older than the last one, and of another sender: neither counts. What is no gaze is told of either.
    send(&headset, "6,0.1,0.1");
    send(&other, "100,0.2,0.2");
    send(&headset, &"8".repeat(2 * LONGEST));
    wait_for(&live, 2);
    assert_eq!((live.at(Instant::now()), live.counts()), (view, [1, 1]));
    // Once the headset is silent, the other one is heard, whatever its clock says.
    thread::sleep(BLINK + Duration::from_millis(50));
    send(&other, "1,0.2,0.4");
    wait_for(&live, 3);
    assert_eq!(
        (live.at(Instant::now()), live.counts()),
        (at(0.2, 0.4), [2, 1])
    );
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
