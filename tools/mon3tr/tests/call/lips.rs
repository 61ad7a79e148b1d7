//! Lips by the voice: what a viewer sees of a mouth that no camera sees is what it hears.

use crate::house::House;
use crate::voice::write_wav;
use link_call::{Authentication, CallEvent, Viewer};
use link_http::Client;
use link_playout::Clock;
use link_voice::{RATE, VoiceQueue};
use spmm3::{Joint, MotionParams};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use synthetic_person::real_files::real_file;

/// How long is looked and listened, after the first second.
const LISTENS: Duration = Duration::from_secs(20);

/// From one moment that is compared to the next, microseconds.
const STEP_US: i64 = 20_000;

/// The speech that the lips' own tests have: by espeak-ng, in mu-law (ITU-T G.711's curve) of 16 kHz. Of each sentence u32 samples, the samples, u32 marks
/// of 5 bytes.
fn speech() -> Vec<f32> {
    let mut rest: &[u8] = include_bytes!("../../../lip-sync/tests/held_out.bin");
    let number = |rest: &mut &[u8]| {
        let (number, after) = rest.split_first_chunk().expect("a number");
        *rest = after;
        u32::from_le_bytes(*number) as usize
    };
    let mut all = Vec::new();
    for _ in 0..3 {
        let count = number(&mut rest);
        let (sound, after) = rest.split_at(count);
        rest = after;
        let sound = sound.iter().map(|byte| {
            let curve = (f32::from(*byte) - 128.0) / 127.0;
            ((256f32.ln() * curve.abs()).exp() - 1.0) / 255.0 * curve.signum()
        });
        let sound: Vec<f32> = sound.collect();
        // 48 kHz, on straight lines.
        all.extend(sound.windows(2).flat_map(|two| {
            [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|share| two[0] + share * (two[1] - two[0]))
        }));
        all.extend(vec![0.0; RATE as usize]);
        let marks = number(&mut rest);
        rest = rest.split_at(5 * marks).1;
    }
    all
}

/// What was seen and heard, by the sender's clock in steps of [`STEP_US`]: openings of the mouth, and loudness.
#[derive(Default)]
struct Observed {
    seen: BTreeMap<i64, f64>,
    heard: BTreeMap<i64, f64>,
    /// How far the lids are shut, in order.
    lids: Vec<f32>,
}

fn observe(house: &House, link: &str) -> Observed {
    let _entered = house.runtime.enter();
    let (clock, voice) = (Clock::start(), VoiceQueue::default());
    let mut player = voice.listen().expect("it can be decoded");
    let client = Client::new(None).expect("a client");
    let link = link.parse().expect("a room's link");
    let viewer = Viewer::join(
        client,
        link,
        Authentication::default(),
        clock,
        voice.clone(),
    );
    let mut observed = Observed::default();
    let mut piece = [0.0; 480];
    let mut due = Instant::now();
    let mut first = None;
    while first.is_none_or(|first: Instant| first.elapsed() < LISTENS) {
        let now = clock.at(due);
        player.play(now, Duration::ZERO, &mut piece);
        if let Some(offset) = voice.heard_offset_us(now) {
            let captured = i64::try_from(now.0).expect("not for long") - offset;
            let power = piece.iter().map(|s| f64::from(s * s)).sum::<f64>() / 480.0;
            observed
                .heard
                .insert(captured / STEP_US, (power + 1e-7).log10());
        }
        due += Duration::from_millis(10);
        loop {
            match viewer.next(due.saturating_duration_since(Instant::now())) {
                Ok(CallEvent::Frame { frame, .. }) => {
                    first.get_or_insert_with(Instant::now);
                    let at = i64::try_from(frame.captured.0).expect("not for long");
                    observed.seen.insert(at / STEP_US, opening(&frame.motion));
                    observed.lids.push(frame.motion.expression()[1]);
                }
                Ok(CallEvent::Failed(error)) => panic!("the call failed: {error}"),
                Ok(_) => {}
                Err(_) => break,
            }
        }
    }
    house.runtime.block_on(viewer.hang_up());
    observed
}

/// Of the puppet's mouth: the jaw, which every shape but closed lips opens.
fn opening(motion: &MotionParams) -> f64 {
    f64::from(motion.axis_angle(Joint::Jaw).x)
}

/// How alike what is seen is to what is heard `lag` steps before, from -1 to 1.
fn correlation(observed: &Observed, lag: i64) -> f64 {
    // Silence is not sent: what was not heard is silence.
    let pairs: Vec<(f64, f64)> = (observed.seen.iter())
        .map(|(at, seen)| {
            (
                *seen,
                observed.heard.get(&(at - lag)).copied().unwrap_or(-7.0),
            )
        })
        .collect();
    let count = pairs.len() as f64;
    let [a, b] = [0, 1].map(|k| pairs.iter().map(|p| [p.0, p.1][k]).sum::<f64>() / count);
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        ab += (x - a) * (y - b);
        aa += (x - a).powi(2);
        bb += (y - b).powi(2);
    }
    ab / (aa * bb).sqrt()
}

#[test]
fn a_mouth_that_no_camera_sees_moves_as_its_voice_is_heard_and_eyes_blink() {
    // A walk has no face.
    let Some(walk) = real_file("mocap/cmu_02_01_walk.bvh") else {
        return;
    };
    let house = House::open();
    let said = house.path("said.wav");
    write_wav(&said, RATE, &speech());
    let said = said.to_string();
    let walk = walk.to_string_lossy();
    let sender = house.sender(&["--motion", &walk, "--voice", &said]);
    let observed = observe(&house, &sender.viewers);
    let widest = observed.seen.values().copied().fold(0.0, f64::max);
    assert!(widest > 0.1, "the jaw opens by {widest} radians");
    let mut shut: Vec<f64> = observed.seen.values().copied().collect();
    shut.sort_by(f64::total_cmp);
    assert!(shut[shut.len() / 10] < 0.02, "between sentences it is shut");
    let best = (-10..=20)
        .map(|lag| (correlation(&observed, lag), lag))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .expect("lags");
    let blinks = (observed.lids.windows(2))
        .filter(|two| two[0] < 0.5 && two[1] >= 0.5)
        .count();
    println!(
        "what is seen and what is heard are alike by {:.2}, {} ms apart; {blinks} blinks in {} s",
        best.0,
        best.1 * STEP_US / 1000,
        LISTENS.as_secs()
    );
    assert!(best.0 > 0.4, "{best:?}");
    assert!((-1..=6).contains(&best.1), "{best:?}: 120 ms at most");
    assert!((2..=12).contains(&blinks), "{blinks} blinks");
    drop(sender);
}
