//! One sender, forwarded to more viewers than it would have itself: all get the same, also after it has come back.

use crate::command::mon3tr;
use crate::house::House;
use crate::voice::write_wav;
use identity::Keyring;
use link_call::forward::Forwarder;
use link_call::{Authentication, CallEvent, Viewer};
use link_codec::Codec;
use link_http::Client;
use link_playout::Clock;
use link_protocol::RoomLink;
use link_voice::VoiceQueue;
use spmm3::Avatar;
use std::collections::HashMap;
use std::time::{Duration, Instant};
use test_support::service::LONGEST_WAIT;
use test_support::speech::syllables;

/// More than a call of several has.
const VIEWERS: usize = 12;

/// By the time of their capture: sequences begin with each viewer that the sender serves itself.
pub(crate) type Frames = HashMap<u64, Vec<u32>>;

/// Takes each viewer's frames until each has so many, or it took too long.
pub(crate) fn frames(viewers: &[Viewer], wanted: usize) -> Vec<Frames> {
    let mut all: Vec<Frames> = viewers.iter().map(|_| Frames::new()).collect();
    let until = Instant::now() + LONGEST_WAIT;
    while all.iter().any(|frames| frames.len() < wanted) {
        assert!(
            Instant::now() < until,
            "{:?} of {wanted} frames each",
            all.iter().map(HashMap::len).collect::<Vec<_>>()
        );
        for (viewer, frames) in viewers.iter().zip(&mut all) {
            match viewer.next(Duration::from_millis(1)) {
                // Times begin anew.
                Ok(CallEvent::Joined) => frames.clear(),
                Ok(CallEvent::Frame { frame, .. }) => {
                    let motion = frame.motion.values().iter().map(|value| value.to_bits());
                    frames.insert(frame.captured.0, motion.collect());
                }
                Ok(_) | Err(_) => {}
            }
        }
    }
    all
}

pub(crate) fn assert_alike(all: &[Frames]) {
    let first = all.first().expect("viewers");
    for other in all {
        let both = other
            .iter()
            .filter_map(|(captured, frame)| Some((first.get(captured)?, frame)));
        let both: Vec<_> = both.collect();
        assert!(both.len() > 20, "they overlap: {}", both.len());
        assert!(
            both.iter().all(|(a, b)| a == b),
            "the same motion at the same times"
        );
    }
}

#[test]
fn an_audience_gets_the_same_motion_and_voice_also_after_the_sender_has_come_back() {
    let house = House::open();
    let said = house.path("said.wav");
    write_wav(&said, link_voice::RATE, &syllables(1));
    let avatar = house.avatar.to_str().expect("UTF-8");
    mon3tr(&["keys", "sign", avatar]).succeeds();
    let signer = Avatar::load(&house.avatar).expect("the package").signer;
    let authentication = Authentication { own: None, signer };
    // Both forwarders have this key.
    let keys = Keyring::open(
        house.path("forwarder.key").into(),
        house.path("permits").into(),
        house.path("trusted").into(),
    )
    .expect("a key");
    let key = keys.identity().public().to_string();
    let permit = mon3tr(&["keys", "allow", &key]).succeeds();
    let permit = permit.split_once("keys accept ").expect("a permit").1;
    keys.accept(&permit.parse().expect("a permit"))
        .expect("kept");
    let sender = house.sender(&["--voice", &said]);
    let runtime = tokio::runtime::Runtime::new().expect("threads");
    let client = Client::new(None).expect("a client");
    let source: RoomLink = sender.viewers.parse().expect("a link");
    let token = house.owner_token();
    let opened = client.open_room(source.server(), &token, None);
    let room = runtime.block_on(opened).expect("a room");
    let clock = Clock::start();
    // The other forwarder is a viewer, too.
    let most = VIEWERS + 1;
    let forwarder = Forwarder::begin(
        client.clone(),
        source,
        room.sender,
        most,
        Some(keys.clone()),
        clock,
    );
    let forwarder = runtime.block_on(forwarder).expect("the sender is there");
    let voices: Vec<VoiceQueue> = (0..VIEWERS).map(|_| VoiceQueue::default()).collect();
    let viewers: Vec<Viewer> = {
        let _network = runtime.enter();
        let join = |voice: &VoiceQueue| {
            Viewer::join(
                client.clone(),
                room.viewer.clone(),
                authentication.clone(),
                clock,
                voice.clone(),
            )
        };
        voices.iter().map(join).collect()
    };
    // A forwarder may forward to others: these are the last viewers.
    let opened = client.open_room(room.viewer.server(), &token, None);
    let further = runtime.block_on(opened).expect("another room");
    let link = room.viewer.clone();
    let second = Forwarder::begin(client.clone(), link, further.sender, 2, Some(keys), clock);
    let second = runtime
        .block_on(second)
        .expect("the first forwarder is there");
    let viewers: Vec<Viewer> = {
        let _network = runtime.enter();
        let further = [(); 2].map(|()| {
            let voice = VoiceQueue::default();
            Viewer::join(
                client.clone(),
                further.viewer.clone(),
                authentication.clone(),
                clock,
                voice,
            )
        });
        viewers.into_iter().chain(further).collect()
    };
    assert_alike(&frames(&viewers, 60));
    for viewer in &viewers {
        let statistics = viewer.statistics();
        assert!(statistics.voice > 20, "{statistics:?}");
        // Only what came before it was told under which session the sender writes.
        assert!(statistics.refused.total() < 10, "{statistics:?}");
        // Both on this machine: what is told is the sender's clock, by way of the forwarder's.
        assert!(statistics.clock_offset_us.is_some(), "{statistics:?}");
    }
    assert_eq!(forwarder.statistics().viewers, most);
    sender.program.kill();
    // Away for longer than a viewer takes a silent connection for a good one: the audience stays.
    std::thread::sleep(Duration::from_secs(3));
    let again = house.send(&["--room", &sender.own, "--avatar", avatar]);
    for viewer in &viewers {
        while viewer.next(Duration::ZERO).is_ok() {}
    }
    assert_alike(&frames(&viewers, 60));
    for viewer in &viewers {
        assert_eq!(
            viewer.statistics().sessions,
            1,
            "one connection all the time"
        );
    }
    again.kill();
    // As another announcement, which the viewers have to read anew.
    let arguments = [
        "--room",
        &sender.own,
        "--avatar",
        avatar,
        "--codec",
        "paper",
    ];
    let _again = house.send(&arguments);
    let until = Instant::now() + LONGEST_WAIT;
    for viewer in &viewers {
        let is_told =
            |event| matches!(event, CallEvent::Announced(told) if told.codec == Codec::Paper);
        while !viewer.next(Duration::from_millis(100)).is_ok_and(is_told) {
            assert!(Instant::now() < until, "they are not told");
        }
    }
    assert_alike(&frames(&viewers, 60));
    while forwarder.statistics().viewers != most {
        assert!(Instant::now() < until, "{:?}", forwarder.statistics());
        std::thread::sleep(Duration::from_millis(50));
    }
    // One too many is refused, and those who are there go on.
    let late = {
        let _network = runtime.enter();
        Viewer::join(
            client,
            room.viewer,
            authentication.clone(),
            clock,
            VoiceQueue::default(),
        )
    };
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(late.statistics().frames, 0, "there is no place");
    assert_eq!(forwarder.statistics().viewers, most);
    runtime.block_on(late.hang_up());
    runtime.block_on(second.end());
    let figures = runtime.block_on(forwarder.end());
    assert!(figures.sent > 60 * VIEWERS as u64, "{figures:?}");
    for viewer in viewers {
        let until = Instant::now() + LONGEST_WAIT;
        let mut has_hung_up = false;
        while !has_hung_up {
            assert!(Instant::now() < until, "no goodbye");
            has_hung_up = matches!(
                viewer.next(Duration::from_millis(100)),
                Ok(CallEvent::HungUp)
            );
        }
    }
}
