//! Summaries of schedules whose figures are known beforehand.

use super::*;
use crate::concealment::ConcealmentState;
use crate::stage::{Lane, Stage, Unit};
use proptest::prelude::*;
use std::time::{Duration, Instant};

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}

fn terms(encode: Option<Duration>) -> Terms {
    Terms {
        display_period: Duration::from_millis(10),
        motion_hz: 25.0,
        units: Stage::ALL.map(|stage| stage.legal_units()[0]),
        encode,
        lost_events: 0,
    }
}

/// States every 40 ms whose frames were captured at 40 k ms, on the way for 20 ms, due 5 ms later, taken 1 ms later, inferred
/// from 2 ms later for 10 ms and ready 4 ms after that: 42 ms after the capture. A picture every 10 ms for each state.
struct Schedule {
    zero: Instant,
    collector: Collector,
}

impl Schedule {
    fn at(&self, ms: f64) -> Instant {
        self.zero + Duration::from_secs_f64(ms / 1e3)
    }

    fn state(&self, number: u64) -> FrameTimes {
        let captured = 40.0 * number as f64;
        let at = |ms: f64| self.at(captured + ms);
        FrameTimes {
            number,
            source: ConcealmentState::Live,
            captured: Some(at(0.0)),
            arrived: at(20.0),
            due: at(25.0),
            released: at(26.0),
            inference: [at(28.0), at(38.0)],
            ready: at(42.0),
        }
    }

    /// Picture `number` lies a quarter further between two states than the one before.
    fn picture(&self, number: u64) -> PictureTimes {
        let (from, quarters) = (number / 4, number % 4);
        let shown = 10.0 * number as f64 + 100.0;
        let at = |ms: f64| self.at(shown + ms);
        PictureTimes {
            number,
            from: self.state(from),
            to: self.state(from + 1),
            alpha: quarters as f32 / 4.0,
            interpolated_for: number,
            interpolation: [at(-12.0), at(-11.0)],
            begun: at(-9.0),
            sorted: at(-5.0),
            drawn: at(-2.0),
            displayed: at(0.0),
            predicted: at(0.0),
            repeated: false,
            gaussians: 60_000,
            scale: 1.0,
        }
    }

    fn new() -> Self {
        let mut this = Self {
            zero: Instant::now(),
            collector: Collector::default(),
        };
        let [mut motion, mut npu, mut cpu, mut gpu] =
            Lane::ALL.map(|lane| this.collector.recorder(lane));
        for number in 0..10 {
            let at = |ms: f64| this.at(40.0 * number as f64 + ms);
            motion.span(Stage::Kinematics, number, at(26.0), at(28.0));
            npu.span(Stage::Inference, number, at(28.0), at(38.0));
            // In two slices, between which the lane does something for the display.
            cpu.span(Stage::Bind, number, at(38.0), at(39.0));
            cpu.span(Stage::Bind, number, at(40.0), at(42.0));
        }
        for number in 0..20 {
            let picture = this.picture(number);
            let [begin, end] = picture.interpolation;
            cpu.span(Stage::Interpolate, number, begin, end);
            gpu.span(Stage::Sort, number, picture.begun, picture.sorted);
            gpu.span(Stage::Raster, number, picture.sorted, picture.drawn);
            gpu.picture(picture);
        }
        this.collector.collect();
        this
    }

    fn summary(&self, encode: Option<Duration>) -> Summary {
        let recording = Recording::new(&self.collector, self.zero, self.at(400.0));
        Summary::new(&recording, &terms(encode))
    }
}

#[test]
fn stages_take_what_the_schedule_says_and_slices_count_together() {
    let summary = Schedule::new().summary(None);
    let rows: Vec<_> = summary
        .stages
        .iter()
        .map(|row| (row.stage, row.unit, row.times.count, row.times.p99_ms))
        .collect();
    let expected = [
        (Stage::Kinematics, Unit::Cpu, 10, 2.0),
        (Stage::Inference, Unit::Npu, 10, 10.0),
        (Stage::Bind, Unit::Cpu, 10, 3.0),
        (Stage::Interpolate, Unit::Cpu, 20, 1.0),
        (Stage::Sort, Unit::Gpu, 20, 4.0),
        (Stage::Raster, Unit::Gpu, 20, 3.0),
    ];
    for (row, expected) in rows.iter().zip(expected) {
        assert_eq!(
            (row.0, row.1, row.2),
            (expected.0, expected.1, expected.2),
            "{row:?}"
        );
        assert!((row.3 - expected.3).abs() < 1e-5, "{row:?}");
    }
    assert_eq!(rows.len(), expected.len(), "no other stages");
    let share = |k: usize| summary.stages[k].display_share.expect("there is a display");
    assert!((share(1) - 0.25).abs() < 1e-6, "10 ms 25 times a second");
    assert!((share(4) - 0.4).abs() < 1e-6, "4 ms of each 10");
}

#[test]
fn lanes_are_busy_and_overlap_as_the_schedule_says() {
    let occupancy = Schedule::new().summary(None).occupancy;
    let busy = |lane: Lane| occupancy.lanes[lane as usize].share;
    // In 400 ms: ten frames' 2 and 10 ms, twenty pictures' 7.
    assert!(near(busy(Lane::Motion), 20.0 / 400.0), "{occupancy:?}");
    assert!(near(busy(Lane::Npu), 100.0 / 400.0), "{occupancy:?}");
    assert!(
        (busy(Lane::Gpu) - 140.0 / 400.0).abs() < 1e-6,
        "{occupancy:?}"
    );
    assert!(
        near(occupancy.at_once.iter().sum(), 1.0),
        "all time is counted once"
    );
    let pair = |lanes: [Lane; 2]| {
        let found = occupancy.pairs.iter().find(|pair| pair.lanes == lanes);
        found.expect("all pairs are there").share
    };
    // The GPU works on a picture from 1 to 8 ms of each 10 from 91 on, inference from 28 to 38 of each 40: while pictures are
    // made (until 288), frames 2 to 6 meet it from 108..118: 7 ms each, of which 5 frames' lie before 288.
    assert!(
        (pair([Lane::Npu, Lane::Gpu]) - 5.0 * 7.0 / 400.0).abs() < 1e-6,
        "{occupancy:?}"
    );
    assert!(
        near(pair([Lane::Motion, Lane::Npu]), 0.0),
        "they follow on each other"
    );
}

#[test]
fn pictures_late_repeated_and_missed_are_counted() {
    let mut schedule = Schedule::new();
    schedule.collector.clear();
    let mut gpu = schedule.collector.recorder(Lane::Gpu);
    for number in 0..12 {
        let mut picture = schedule.picture(number);
        match number {
            // Two blanks later than it should, which are missed.
            5.. => {
                picture.displayed += Duration::from_millis(20);
                if number == 5 {
                    picture.repeated = true;
                } else {
                    picture.predicted += Duration::from_millis(20);
                }
            }
            // A little later than the blank: that is the clock, not the picture.
            3 => picture.displayed += Duration::from_millis(2),
            _ => {}
        }
        if number > 8 {
            picture.scale = 0.8;
        }
        // What a frustum makes of the count is no other quality.
        picture.gaussians += u32::try_from(number).expect("small");
        gpu.picture(picture);
    }
    schedule.collector.collect();
    let pictures = schedule.summary(None).pictures;
    assert_eq!(
        (
            pictures.shown,
            pictures.repeated,
            pictures.late,
            pictures.missed_vblanks
        ),
        (12, 1, 1, 2),
        "{pictures:?}"
    );
    assert!(near(pictures.per_second, 11.0 / 0.13), "{pictures:?}");
    assert!(near(pictures.fresh_per_second, 10.0 / 0.13), "{pictures:?}");
    let scales: Vec<f32> = pictures.quality.iter().map(|one| one.scale).collect();
    assert_eq!(scales, [1.0, 0.8], "{pictures:?}");
}

#[test]
fn latency_is_that_of_the_schedule_part_by_part() {
    let latency = Schedule::new()
        .summary(Some(Duration::from_millis(3)))
        .latency
        .expect("there are pictures");
    // Picture n shows the moment 10 n ms, at 10 n + 100.
    for time in [
        latency.whole.mean_ms,
        latency.whole.p50_ms,
        latency.whole.max_ms,
    ] {
        assert!((time - 100.0).abs() < 1e-4, "{latency:?}");
    }
    // The newer state is captured up to 40 ms after the moment that the picture shows and ready 42 ms later; interpolation
    // begins 88 ms after the moment. So 46 ms are held, whichever quarter it is.
    let expected = [
        3.0, 17.0, 5.0, 3.0, 10.0, 4.0, 46.0, 1.0, 2.0, 4.0, 3.0, 2.0,
    ];
    assert_eq!(latency.parts.len(), expected.len(), "all parts are known");
    for (part, expected) in latency.parts.iter().zip(expected) {
        assert!((part.times.p50_ms - expected).abs() < 1e-4, "{part:?}");
    }
}

#[test]
fn pictures_whose_capture_is_unknown_are_left_out_or_counted_from_arrival() {
    let schedule = Schedule::new();
    let mut pictures: Vec<_> = (0..4).map(|number| schedule.picture(number)).collect();
    pictures[1].from.captured = None;
    let latency = LatencyBreakdown::new(&pictures, None).expect("pictures");
    assert_eq!(
        (latency.since, latency.left_out),
        (Since::Capture, 1),
        "one is unknown"
    );
    assert!(
        latency.parts.iter().all(|one| one.part != Part::Encode),
        "nobody told what encoding takes"
    );
    for picture in &mut pictures {
        picture.to.captured = None;
    }
    let latency = LatencyBreakdown::new(&pictures, None).expect("pictures");
    assert_eq!(
        (latency.since, latency.left_out),
        (Since::Arrival, 0),
        "all are"
    );
    assert_eq!(
        latency.parts[0].part,
        Part::JitterBuffer,
        "it begins with arrival"
    );
    assert!((latency.whole.p50_ms - 80.0).abs() < 1e-4, "20 ms less");
    assert_eq!(LatencyBreakdown::new(&[], None), None, "of nothing");
}

#[test]
fn what_had_to_be_forgotten_is_not_measured_as_idleness() {
    let zero = Instant::now();
    let at = |ms: u64| zero + Duration::from_millis(ms);
    let mut collector = Collector::default();
    let mut cpu = collector.recorder(Lane::Cpu);
    const SPANS: u64 = 200_000;
    for number in 0..SPANS {
        cpu.span(Stage::Bind, number, at(2 * number), at(2 * number + 1));
        if number % 1000 == 0 {
            collector.collect();
        }
    }
    collector.collect();
    let recording = Recording::new(&collector, zero, at(2 * SPANS));
    assert!(recording.begin > zero, "the first are forgotten");
    let summary = Summary::new(&recording, &terms(None));
    let busy = summary.occupancy.lanes[Lane::Cpu as usize].share;
    assert!((busy - 0.5).abs() < 1e-4, "half of the time: {busy}");
}

prop_compose! {
    /// A picture whose times follow on each other as they may, for which a capture may be known.
    fn pictures()(
        gaps in proptest::array::uniform16(0_u64..30_000_000),
        alpha in -0.5_f32..2.0,
        captured in proptest::option::of((0_u64..90_000_000, 0_u64..90_000_000)),
        due in 0_u64..200_000_000,
    ) -> (Instant, PictureTimes) {
        let zero = Instant::now();
        let mut now = 100_000_000;
        let mut times = gaps.into_iter().map(|gap| {
            now += gap;
            zero + Duration::from_nanos(now)
        });
        let mut next = || times.next().expect("sixteen are enough");
        let (older, arrived, released) = (next(), next(), next());
        let state = |captured: Option<u64>, arrived| FrameTimes {
            number: 1,
            source: ConcealmentState::Live,
            captured: captured.map(|ns| zero + Duration::from_nanos(ns)),
            arrived,
            due: zero + Duration::from_nanos(due),
            released,
            inference: [arrived; 2],
            ready: arrived,
        };
        let from = state(captured.map(|both| both.0), older);
        let inference = [next(), next()];
        let to = FrameTimes { inference, ready: next(), ..state(captured.map(|both| both.1), arrived) };
        let picture = PictureTimes {
            number: 1, from, to, alpha, interpolated_for: 1,
            interpolation: [next(), next()],
            begun: next(),
            sorted: next(),
            drawn: next(),
            displayed: next(),
            predicted: zero,
            repeated: false,
            gaussians: 1,
            scale: 1.0,
        };
        (zero, picture)
    }
}

proptest! {
    #[test]
    fn parts_add_up_to_the_whole_to_the_nanosecond(
        (zero, picture) in pictures(),
        encode in proptest::option::of(0_u64..40_000_000),
    ) {
        let latency = PictureLatency::new(&picture, encode.map(Duration::from_nanos));
        // Apart from the parts: when it was displayed less when its content was captured, in f64 from one zero.
        let since = |at: Instant| at.duration_since(zero).as_nanos() as f64;
        let [before, after] = match (picture.from.captured, picture.to.captured) {
            (Some(before), Some(after)) => [since(before), since(after)],
            _ => [since(picture.from.arrived), since(picture.to.arrived)],
        };
        let content = before + f64::from(picture.alpha) * (after - before);
        let whole = since(picture.displayed) - content;
        prop_assert!((latency.whole() as f64 - whole).abs() <= 0.6, "{} against {whole}", latency.whole());
        // Only these may be negative: the comparison of clocks, and extrapolation.
        for (part, ns) in Part::ALL.into_iter().zip(latency.parts) {
            prop_assert!(ns >= 0 || matches!(part, Part::Network | Part::Hold), "{}: {ns}", part.name());
        }
    }
}
