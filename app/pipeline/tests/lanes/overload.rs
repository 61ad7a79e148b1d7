//! A device that takes long for each picture: what is shown is late by that, and by no more.

use crate::stage::{CPU, Stage, Swing};
use app_pipeline::plan::Plan;
use app_pipeline::profile::PictureTimes;
use std::time::Duration;
use test_support::vulkan;

/// Motion frames a second.
const MOTION_HERTZ: u32 = 30;

/// Other tests of this program take the processors at times, and motion is late then: each bound may be missed twice.
const ATTEMPTS: usize = 3;
/// Pictures until all is settled: the first are drawn while programs are compiled.
const SETTLES: usize = 3;

/// From the capture of the moment that a picture shows until it is displayed.
fn latency(picture: &PictureTimes) -> Option<Duration> {
    let (from, to) = (picture.from.captured?, picture.to.captured?);
    let captured = from + (to - from).mul_f32(picture.alpha.clamp(0.0, 1.0));
    Some(picture.displayed.saturating_duration_since(captured))
}

/// The latencies of pictures of which each takes `took` and whatever the machine takes besides, and the longest time between two.
fn of_slow(took: Duration, pictures: usize, plan: Plan) -> Option<(Vec<Duration>, Duration)> {
    let gpu = vulkan::gpu()?;
    let swing = Swing::new(f64::from(MOTION_HERTZ), 100_000, 0.5);
    let mut stage = Stage::new(&gpu, plan, &[CPU], swing)?;
    stage.draw_until_seen(1);
    stage.slowed = took;
    let before = stage.lanes.collector().pictures().count();
    stage.draw(u32::try_from(pictures + SETTLES).expect("few"));
    let collector = stage.lanes.collector();
    let shown: Vec<&PictureTimes> = collector.pictures().skip(before + SETTLES).collect();
    let gaps = shown
        .windows(2)
        .map(|pair| pair[1].displayed - pair[0].displayed);
    let longest = gaps.max().expect("several pictures");
    let latencies = shown.iter().filter_map(|picture| latency(picture));
    Some((latencies.collect(), longest))
}

#[test]
fn motion_is_shown_within_two_pictures_and_two_motion_periods_at_one_five_and_ten_pictures_a_second()
 {
    for plan in [Plan::CpuTail, Plan::Gpu] {
        for (hertz, pictures) in [(1, 4), (5, 15), (10, 25)] {
            let took = Duration::from_secs(1) / hertz;
            let mut beyond = Vec::new();
            while beyond.len() < ATTEMPTS {
                let Some((latencies, picture)) = of_slow(took, pictures, plan) else {
                    return;
                };
                assert!(latencies.len() >= pictures, "{latencies:?}");
                let worst = *latencies.iter().max().expect("some");
                println!(
                    "{plan:?} at {hertz} Hz: {worst:?} at most, pictures take {picture:?} at most"
                );
                // What the machine really took for a picture counts.
                if worst <= picture * 2 + Duration::from_secs(2) / MOTION_HERTZ {
                    break;
                }
                beyond.push(latencies);
            }
            assert!(
                beyond.len() < ATTEMPTS,
                "{plan:?} at {hertz} Hz, each time: {beyond:?}"
            );
        }
    }
}
