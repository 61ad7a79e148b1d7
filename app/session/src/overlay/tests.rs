//! The panel's pixels, and its figures against a schedule known beforehand.

use super::glyphs::Glyphs;
use super::layout::{HEIGHT, Item, Rect, Shape, WIDTH, items};
use super::words::NONE;
use super::*;
use crate::call::{CallCounts, CallWatch};
use app_pipeline::concealment::ConcealmentState;
use app_pipeline::placement::PlacementReport;
use app_pipeline::plan::Plan;
use app_pipeline::profile::{Collector, FrameTimes, PictureTimes, Recording, Since};
use app_pipeline::quality::{LADDER, Quality, QualityController, QualityFigures, QualityMode};
use app_pipeline::stage::{Lane, Stage, Unit};
use npu_runtime::{Landing, Origin, Provider};
use proptest::prelude::*;
use std::time::{Duration, Instant};

/// A call that goes well on a headset of 72 Hz.
fn ordinary() -> OverlayFigures {
    let frames = (0..144).map(|k| {
        let is_late = k % 48 == 40;
        let wave = (k as f32 * 0.35).sin() + 0.6 * (k as f32 * 0.11).sin();
        FrameTime {
            ms: if is_late { 17.5 } else { 9.6 + wave },
            is_late,
        }
    });
    let load = |ms: f64| UnitLoad {
        ms,
        share: ms * 0.0719,
    };
    OverlayFigures {
        shown_hz: Some(71.4),
        display_hz: Some(72.0),
        frames: frames.collect(),
        late_in_all: Some(17),
        units: [Some(load(3.9)), Some(load(9.2)), Some(load(2.6))],
        latency: Some(OverlayLatency {
            since: Since::Capture,
            p50_ms: 87.3,
            p95_ms: 112.0,
        }),
        kbit_s: Some(117.6),
        loss: Some(0.0042),
        placement: Some("npu on QNN for SM8550".to_owned()),
        gaussians: Some(60_035),
        quality: Some(LADDER[1]),
    }
}

/// Values that no call has, each as long as it can be written.
fn extreme() -> OverlayFigures {
    let load = UnitLoad {
        ms: f64::MAX,
        share: f64::INFINITY,
    };
    OverlayFigures {
        shown_hz: Some(-99_999.0),
        display_hz: Some(1e300),
        frames: vec![
            FrameTime {
                ms: f32::NAN,
                is_late: true
            };
            5_000
        ],
        late_in_all: Some(u64::MAX),
        units: [Some(load); 3],
        latency: Some(OverlayLatency {
            since: Since::Arrival,
            p50_ms: f64::NEG_INFINITY,
            p95_ms: -123_456.0,
        }),
        kbit_s: Some(999_999.0),
        loss: Some(f64::NAN),
        placement: Some("cpu-tail on XNNPACK with 18446744073709551615 threads".to_owned()),
        gaussians: Some(u32::MAX),
        quality: Some(Quality {
            sort_every: u32::MAX,
            resolution_scale: f32::MAX,
            ..LADDER[7]
        }),
    }
}

fn texts(items: &[Item]) -> Vec<(&Rect, &str)> {
    items
        .iter()
        .filter_map(|item| match &item.shape {
            Shape::Text { text, .. } => Some((&item.place, text.as_str())),
            Shape::Fill(_) => None,
        })
        .collect()
}

fn meet(a: &Rect, b: &Rect) -> bool {
    a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height
}

#[test]
fn no_text_meets_another_or_a_bar_whatever_the_figures_are() {
    for figures in [OverlayFigures::default(), ordinary(), extreme()] {
        let items = items(&figures);
        let texts = texts(&items);
        assert!(texts.len() > 20, "rows of text");
        for (k, (place, text)) in texts.iter().enumerate() {
            for (other, its) in &texts[k + 1..] {
                assert!(!meet(place, other), "{text:?} meets {its:?}");
            }
            let fills = items
                .iter()
                .filter(|item| matches!(item.shape, Shape::Fill(_)));
            for fill in fills {
                assert!(!meet(place, &fill.place), "{text:?} meets {:?}", fill.place);
            }
        }
        for Item { place, .. } in &items {
            let inside = place.x + place.width <= WIDTH && place.y + place.height <= HEIGHT;
            assert!(inside, "{place:?} is on the panel");
        }
    }
}

#[test]
fn every_text_is_seen_in_its_place_and_nowhere_else() {
    let card = panel::card(WIDTH, HEIGHT);
    let mut glyphs = Glyphs::default();
    for figures in [ordinary(), extreme()] {
        for item in items(&figures) {
            let mut drawn = card.clone();
            drawn.draw(&item, &mut glyphs);
            let changed = |at: &usize| drawn.pixels[4 * at..][..4] != card.pixels[4 * at..][..4];
            let changed: Vec<usize> = (0..(WIDTH * HEIGHT) as usize).filter(changed).collect();
            let Rect {
                x,
                y,
                width,
                height,
            } = item.place;
            let outside = changed.iter().find(|at| {
                let (column, row) = (**at % WIDTH as usize, **at / WIDTH as usize);
                let across = (x as usize..(x + width) as usize).contains(&column);
                !(across && (y as usize..(y + height) as usize).contains(&row))
            });
            assert_eq!(outside, None, "{item:?}");
            if let Shape::Text { text, .. } = &item.shape {
                let letters = text.chars().filter(|letter| *letter != ' ').count();
                assert!(changed.len() > 8 * letters, "{text:?} can be seen");
            }
        }
    }
}

#[test]
fn text_that_is_too_long_is_cut_and_says_so() {
    let items = items(&extreme());
    let cut: Vec<&str> = texts(&items)
        .into_iter()
        .map(|(_, text)| text)
        .filter(|text| text.starts_with("cpu-tail"))
        .collect();
    assert_eq!(
        cut,
        ["cpu-tail on XNNPACK with 1844674\u{2026}"],
        "the placement"
    );
}

#[test]
fn what_is_not_known_is_a_dash() {
    let nothing = items(&OverlayFigures::default());
    let dashes = texts(&nothing)
        .iter()
        .filter(|(_, text)| *text == NONE)
        .count();
    // Two in each of six rows, and one for each unit.
    assert_eq!(dashes, 15, "figures of nothing");
    let all = items(&ordinary());
    assert!(
        texts(&all).iter().all(|(_, text)| *text != NONE),
        "no dash where all is known"
    );
}

#[test]
fn the_panel_is_drawn_again_only_if_it_looks_different() {
    let mut overlay = Overlay::default();
    let first = overlay
        .update(&ordinary())
        .expect("the first panel")
        .clone();
    assert_eq!(overlay.update(&ordinary()), None, "the same figures");
    let nearly = OverlayFigures {
        kbit_s: Some(117.9),
        ..ordinary()
    };
    assert_eq!(
        overlay.update(&nearly),
        None,
        "a difference that is not shown"
    );
    let other = OverlayFigures {
        kbit_s: Some(119.0),
        ..ordinary()
    };
    let second = overlay.update(&other).expect("another panel").clone();
    assert_ne!(first, second, "it shows the difference");
    let back = overlay.update(&ordinary()).expect("the first again");
    assert_eq!(*back, first, "nothing of what was drawn before stays");
}

#[test]
fn colours_are_premultiplied_for_blended_light() {
    let mut overlay = Overlay::default();
    let panel = overlay.update(&ordinary()).expect("a panel");
    assert_eq!(
        panel.pixels.len(),
        (panel.width * panel.height * 4) as usize,
        "four bytes a pixel"
    );
    // Independent, in f64: no light but what the alpha leaves room for.
    let most = |alpha: u8| {
        let light = f64::from(alpha) / 255.0;
        let value = if light <= 0.003_130_8 {
            12.92 * light
        } else {
            1.055 * light.powf(1.0 / 2.4) - 0.055
        };
        255.0 * value + 1.0
    };
    for pixel in panel.pixels.chunks_exact(4) {
        let brightest = pixel[..3].iter().max().copied().unwrap_or(0);
        assert!(f64::from(brightest) <= most(pixel[3]), "{pixel:?}");
    }
    let at = |x: u32, y: u32| &panel.pixels[((y * panel.width + x) * 4) as usize..][..4];
    for corner in [
        at(0, 0),
        at(panel.width - 1, 0),
        at(0, panel.height - 1),
        at(panel.width - 1, panel.height - 1),
    ] {
        assert_eq!(corner, [0; 4], "round corners");
    }
    // 17/255 is 0.00561 of the light, 0.95 of which displays as 0.0641: 16.
    assert_eq!(at(320, 4), [16, 19, 25, 242], "the card's own colour");
}

proptest! {
    #[test]
    fn any_figures_make_a_panel(
        numbers in proptest::collection::vec(any::<f64>(), 12),
        frames in proptest::collection::vec((any::<f32>(), any::<bool>()), 0..300),
        whole in any::<(u64, u32)>(),
        placement in any::<String>(),
    ) {
        let load = |k: usize| Some(UnitLoad { ms: numbers[k], share: numbers[k + 1] });
        let figures = OverlayFigures {
            shown_hz: Some(numbers[0]),
            display_hz: Some(numbers[1]),
            frames: frames.into_iter().map(|(ms, is_late)| FrameTime { ms, is_late }).collect(),
            late_in_all: Some(whole.0),
            units: [load(2), load(3), None],
            latency: Some(OverlayLatency { since: Since::Arrival, p50_ms: numbers[5], p95_ms: numbers[6] }),
            kbit_s: Some(numbers[7]),
            loss: Some(numbers[8]),
            placement: Some(placement),
            gaussians: Some(whole.1),
            quality: None,
        };
        let items = items(&figures);
        for (k, (place, text)) in texts(&items).iter().enumerate() {
            for (other, its) in &texts(&items)[k + 1..] {
                prop_assert!(!meet(place, other), "{text:?} meets {its:?}");
            }
        }
        prop_assert!(Overlay::default().update(&figures).is_some(), "drawn");
    }
}

#[test]
fn the_painter_draws_what_the_overlay_draws() {
    let mut painter = OverlayPainter::start().expect("a thread");
    assert_eq!(painter.panel(), None, "nothing to be drawn yet");
    painter.show(ordinary());
    let deadline = Instant::now() + Duration::from_secs(60);
    let panel = loop {
        if let Some(panel) = painter.panel() {
            break panel.clone();
        }
        assert!(Instant::now() < deadline, "a panel comes");
        std::thread::sleep(Duration::from_millis(1));
    };
    assert_eq!(
        Some(&panel),
        Overlay::default().update(&ordinary()),
        "the same panel"
    );
}

/// A minute at 100 Hz: the NPU works 10 ms of every 40, CPU 2 and GPU 5 of every 10; what a picture shows was captured 90 ms
/// before. Every 50th picture is shown a blank late.
struct Minute {
    zero: Instant,
    collector: Collector,
}

const PERIOD: Duration = Duration::from_millis(10);

impl Minute {
    fn new() -> Self {
        let zero = Instant::now();
        let at = |ms: u64| zero + Duration::from_millis(ms);
        let mut collector = Collector::default();
        let [_, mut npu, mut cpu, mut gpu] = Lane::ALL.map(|lane| collector.recorder(lane));
        for number in 0..6_000 {
            let begun = 10 * number;
            if number % 4 == 0 {
                npu.span(Stage::Inference, number / 4, at(begun), at(begun + 10));
            }
            cpu.span(Stage::Interpolate, number, at(begun + 1), at(begun + 3));
            gpu.span(Stage::Raster, number, at(begun + 4), at(begun + 9));
            let late = if number % 50 == 49 { 9 } else { 0 };
            let state = FrameTimes {
                number,
                captured: at(begun).checked_sub(Duration::from_millis(80)),
                ..FrameTimes::new(ConcealmentState::Live, at(begun))
            };
            gpu.picture(PictureTimes {
                number,
                from: state,
                to: state,
                alpha: 1.0,
                interpolated_for: number,
                interpolation: [at(begun + 1), at(begun + 3)],
                begun: at(begun),
                sorted: at(begun + 4),
                drawn: at(begun + 9),
                displayed: at(begun + 10 + late),
                predicted: at(begun + 10),
                repeated: false,
                gaussians: 45_000,
                scale: 1.0,
            });
            if number % 10 == 9 {
                collector.collect();
            }
        }
        Self { zero, collector }
    }

    fn at(&self, ms: u64) -> Instant {
        self.zero + Duration::from_millis(ms)
    }
}

fn placed() -> PlacementReport {
    PlacementReport {
        requested: "npu".to_owned(),
        plan: Plan::Npu,
        provider: Some(Provider::Nnapi),
        units: Vec::new(),
        reason: String::new(),
        alternatives: Vec::new(),
        providers: Vec::new(),
        landing: Some(Landing::default()),
        graph: Some(Origin::Plain),
        changes: Vec::new(),
    }
}

fn held() -> QualityFigures {
    QualityFigures {
        pictures: 6_000,
        late_pictures: 120,
        ..QualityController::new(PERIOD, QualityMode::Adapt).figures()
    }
}

fn near(value: Option<f64>, expected: f64) -> bool {
    value.is_some_and(|value| (value - expected).abs() < 1e-6)
}

#[test]
fn figures_are_those_of_the_last_two_seconds() {
    let minute = Minute::new();
    let mut watch = OverlayWatch::since(placed(), None, minute.zero);
    // Between two pictures: what is displayed later is yet to come.
    let now = minute.at(59_905);
    let figures = watch.figures(&minute.collector, &held(), PERIOD, now);
    assert!(near(figures.shown_hz, 100.0), "{:?}", figures.shown_hz);
    assert_eq!(figures.frames.len(), 200, "pictures in two seconds");
    let late = figures.frames.iter().filter(|one| one.is_late).count();
    assert_eq!((late, figures.late_in_all), (4, Some(120)), "late ones");
    assert!(
        figures.frames.iter().all(|one| (one.ms - 9.0).abs() < 1e-3),
        "begun to drawn"
    );
    for (unit, ms, share) in [
        (Unit::Npu, 2.5, 0.25),
        (Unit::Gpu, 5.0, 0.5),
        (Unit::Cpu, 2.0, 0.2),
    ] {
        let load = figures.units[unit as usize].expect("placed");
        assert!(
            near(Some(load.ms), ms) && near(Some(load.share), share),
            "{unit:?}: {load:?}"
        );
    }
    let latency = figures.latency.expect("pictures");
    assert_eq!(latency.since, Since::Capture, "captures are known");
    assert!(near(Some(latency.p50_ms), 90.0), "{latency:?}");
    assert!(near(Some(latency.p95_ms), 90.0), "{latency:?}");
    assert_eq!(figures.gaussians, Some(45_000), "drawn");
    assert_eq!(
        figures.placement.as_deref(),
        Some("npu on NNAPI"),
        "placement"
    );
    assert_eq!((figures.kbit_s, figures.loss), (None, None), "no call");
}

#[test]
fn before_the_first_picture_only_the_placement_and_the_display_are_known() {
    let now = Instant::now();
    let mut watch = OverlayWatch::since(placed(), Some(CallWatch::default()), now);
    let hold = QualityController::new(PERIOD, QualityMode::Adapt).figures();
    let figures = watch.figures(&Collector::default(), &hold, PERIOD, now);
    let expected = OverlayFigures {
        display_hz: Some(100.0),
        placement: Some("npu on NNAPI".to_owned()),
        quality: Some(LADDER[0]),
        ..OverlayFigures::default()
    };
    assert_eq!(figures, expected, "at the very beginning");
}

#[test]
fn the_newest_recording_is_the_end_of_the_whole_one() {
    let minute = Minute::new();
    for (begin, end) in [(58_000, 60_000), (3_000, 60_000), (57_777, 59_123)] {
        let [begin, end] = [begin, end].map(|ms| minute.at(ms));
        let newest = Recording::newest(&minute.collector, begin, end);
        let whole = Recording::new(&minute.collector, begin, end);
        assert_eq!(newest.spans, whole.spans, "spans");
        assert_eq!(newest.pictures, whole.pictures, "pictures");
        assert!(!newest.spans.is_empty(), "there are some");
    }
}

#[test]
fn what_comes_is_of_two_seconds_and_what_is_lost_of_ten() {
    let zero = Instant::now();
    let call = CallWatch::default();
    let mut watch = OverlayWatch::since(placed(), Some(call.clone()), zero);
    let mut counts = CallCounts::default();
    let mut shown = Vec::new();
    for half_second in 0..60u64 {
        // 15 frames of 500 bytes in half a second: 120 kbit/s; the second half of the half minute brings nothing but gaps.
        if half_second < 30 {
            counts.frames += 15;
            counts.payload_bytes += 7_500;
        }
        if half_second % 2 == 1 {
            counts.lost += 1;
        }
        call.tell(counts);
        shown.push(watch.network(zero + Duration::from_millis(500 * half_second)));
    }
    assert_eq!(shown[0], (None, None), "one count makes no rate");
    let (kbit_s, loss) = shown[29];
    assert!(near(kbit_s, 120.0), "{kbit_s:?}");
    // Of the last 20 half seconds: 10 lost, 300 came.
    assert!(near(loss, 10.0 / 310.0), "{loss:?}");
    let (kbit_s, loss) = shown[33];
    assert!(near(kbit_s, 0.0), "two seconds after the last: {kbit_s:?}");
    assert!(near(loss, 10.0 / 250.0), "{loss:?}");
    assert!(near(shown[59].1, 1.0), "all of the last ten seconds");
}
