//! Against a real PulseAudio that the test starts, with devices that play and record nothing.

use sound_devices::{Fill, Loudspeaker, Microphone, RATE, SoundError, SoundServer};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use test_support::pulse::Pulse;
use test_support::service::LONGEST_WAIT;

const FRAME: usize = 960;

const ROOM: &str = "sink_name=room rate=44100 channels=2";

/// Clicks, the first sample of each 250 ms, and when they are heard.
fn clicks() -> (Fill, Receiver<Instant>) {
    let (tell, told) = channel();
    let mut count = 0u64;
    let fill = move |at: Instant, after: Duration, out: &mut [[f32; 2]]| {
        for (k, both) in out.iter_mut().enumerate() {
            let place = count % 12_000;
            count += 1;
            // 2 ms at 1 kHz: a single sample would be smeared where the rate is converted.
            *both = [if place < 96 {
                (place as f32 * 0.131).sin()
            } else {
                0.0
            }; 2];
            if place == 0 {
                let within = Duration::from_secs_f64(k as f64 / f64::from(RATE));
                let _ = tell.send(at + within + after);
            }
        }
    };
    (Box::new(fill), told)
}

/// Listens for so many seconds; when clicks were in the air.
fn listen(microphone: &mut Microphone, seconds: f32) -> Vec<Instant> {
    let mut frame = [0.0; FRAME];
    let mut heard: Vec<Instant> = Vec::new();
    let begun = Instant::now();
    while begun.elapsed().as_secs_f32() < seconds {
        let Some(spoken) = microphone.next(&mut frame, Duration::from_millis(200)) else {
            continue;
        };
        let at = |k: usize| spoken + Duration::from_secs_f64(k as f64 / f64::from(RATE));
        for (k, _) in frame.iter().enumerate().filter(|(_, s)| s.abs() > 0.3) {
            let is_new = heard.last().is_none_or(|last| {
                at(k).saturating_duration_since(*last) > Duration::from_millis(100)
            });
            if is_new {
                heard.push(at(k));
            }
        }
    }
    heard
}

fn apart_ms(a: Instant, b: Instant) -> f64 {
    let after = a.saturating_duration_since(b) + b.saturating_duration_since(a);
    after.as_secs_f64() * 1e3
}

#[test]
fn what_a_loudspeaker_plays_a_microphone_hears_and_both_know_when() {
    let Some(pulse) = Pulse::start() else { return };
    pulse.add("module-null-sink", ROOM);
    let server = SoundServer::at(pulse.socket());
    let (fill, told) = clicks();
    let loudspeaker = Loudspeaker::begin(&server, None, fill).expect("a loudspeaker");
    assert_eq!(loudspeaker.name(), "room");
    let mut microphone = Microphone::open(&server, Some("room.monitor")).expect("a microphone");
    assert!(hears(&mut microphone), "clicks");
    // The delays are measured once a second.
    listen(&mut microphone, 3.0);
    let heard = listen(&mut microphone, 4.0);
    drop(loudspeaker);
    let told: Vec<Instant> = told.try_iter().collect();
    let away: Vec<f64> = heard
        .iter()
        .map(|heard| {
            let nearest = told.iter().map(|told| apart_ms(*told, *heard));
            nearest.fold(f64::MAX, f64::min)
        })
        .collect();
    println!("{} clicks, {away:?} ms apart", heard.len());
    // Four a second; a busy machine may lose some.
    assert!((8..=18).contains(&heard.len()), "{} clicks", heard.len());
    let mut sorted = away.clone();
    sorted.sort_by(f64::total_cmp);
    assert!(sorted[sorted.len() / 2] < 25.0, "{away:?} ms apart");
}

#[test]
fn devices_that_are_not_there_are_named() {
    let Some(pulse) = Pulse::start() else { return };
    let server = SoundServer::at(pulse.socket());
    let silent: fn() -> Fill = || Box::new(|_, _, out: &mut [[f32; 2]]| out.fill([0.0; 2]));
    let microphone = |name| {
        Microphone::open(&server, name)
            .expect_err("none")
            .to_string()
    };
    let loudspeaker = |name| {
        Loudspeaker::begin(&server, name, silent())
            .expect_err("none")
            .to_string()
    };
    assert!(
        loudspeaker(None).contains("no loudspeaker"),
        "{}",
        loudspeaker(None)
    );
    pulse.add("module-null-sink", ROOM);
    // What is heard on a loudspeaker is no microphone.
    let why = microphone(None);
    assert!(
        why.contains("no microphone") && why.contains("room.monitor"),
        "{why}"
    );
    let why = microphone(Some("headset"));
    assert!(
        why.contains("headset") && why.contains("room.monitor"),
        "{why}"
    );
    let why = loudspeaker(Some("headset"));
    assert!(why.contains("headset") && why.contains("room"), "{why}");
    pulse.add(
        "module-remap-source",
        "source_name=headset master=room.monitor",
    );
    let found = Microphone::open(&server, None).expect("a microphone");
    assert_eq!(found.name(), "headset");
    drop(pulse);
    let gone = Microphone::open(&server, None).expect_err("none");
    assert!(matches!(gone, SoundError::Unreachable { .. }), "{gone:?}");
}

/// Listens until it hears something.
fn hears(microphone: &mut Microphone) -> bool {
    let begun = Instant::now();
    while begun.elapsed() < LONGEST_WAIT {
        if listen(microphone, 1.0).len() > 2 {
            return true;
        }
    }
    false
}

#[test]
fn devices_that_vanish_are_taken_up_again() {
    let Some(mut pulse) = Pulse::start() else {
        return;
    };
    let room = pulse.add("module-null-sink", ROOM);
    let server = SoundServer::at(pulse.socket());
    let (fill, _told) = clicks();
    let loudspeaker = Loudspeaker::begin(&server, Some("room"), fill).expect("a loudspeaker");
    let mut microphone = Microphone::open(&server, Some("room.monitor")).expect("a microphone");
    assert!(hears(&mut microphone), "at first");
    pulse.remove(room);
    // What was on its way may still come.
    listen(&mut microphone, 0.5);
    let heard = listen(&mut microphone, 1.0);
    assert!(heard.is_empty(), "{} clicks of no device", heard.len());
    pulse.add("module-null-sink", ROOM);
    assert!(hears(&mut microphone), "after the device is back");
    // The same with the whole server.
    pulse.kill();
    listen(&mut microphone, 0.5);
    let heard = listen(&mut microphone, 1.0);
    assert!(heard.is_empty(), "{} clicks of no server", heard.len());
    pulse.start_again();
    pulse.add("module-null-sink", ROOM);
    assert!(hears(&mut microphone), "after the server is back");
    drop(loudspeaker);
}

#[test]
fn a_microphone_that_nobody_listened_to_for_long_is_there_at_once() {
    let Some(pulse) = Pulse::start() else { return };
    pulse.add("module-null-sink", ROOM);
    let server = SoundServer::at(pulse.socket());
    let mut microphone = Microphone::open(&server, Some("room.monitor")).expect("a microphone");
    let mut frame = [0.0; 480];
    for skips in [false, true] {
        // Longer than a stream may be idle.
        std::thread::sleep(Duration::from_secs(5));
        if skips {
            microphone.skip();
        }
        let heard = microphone.next(&mut frame, Duration::from_millis(400));
        assert!(
            heard.is_some(),
            "lost, though it was there (skipped: {skips})"
        );
    }
}
