//! What profiling itself costs: a lane's part of an event, the collector's part, and what that is of a second at the fastest
//! display's and motion's rates. The yardstick is one look at the clock, without which nothing is measured.

use super::measure::{median, print_table};
use app_pipeline::concealment::ConcealmentState;
use app_pipeline::profile::{Collector, Event, FrameTimes, PictureTimes};
use app_pipeline::stage::{Lane, Stage};
use mon3tr::report::{check_writable, write_json};
use serde::Serialize;
use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

/// Events told in a row: half of what a lane's queue holds.
const BATCH: u32 = 2048;
const ROUNDS: usize = 301;

/// A display of 120 Hz and motion of 60 Hz, with bind in four slices.
const DISPLAY_HZ: f64 = 120.0;
const MOTION_HZ: f64 = 60.0;
const SPANS_A_PICTURE: f64 = 6.0;
const SPANS_A_MOTION: f64 = 7.0;

/// Options of `bench profiler`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Write every figure as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Medians of rounds, nanoseconds an event.
#[derive(Debug, Serialize)]
struct Measured {
    /// One look at the clock.
    clock_ns: f64,
    /// A span between times that are known.
    span_ns: f64,
    /// A span that ends now.
    span_until_now_ns: f64,
    /// A picture.
    picture_ns: f64,
    /// Taking one event out of its queue and keeping it.
    collect_span_ns: f64,
    collect_picture_ns: f64,
    event_bytes: usize,
    events_per_second: f64,
    /// Of one core's time, all lanes and the collector together.
    share: f64,
}

/// Measures and prints.
pub(crate) fn run(options: &Options) -> anyhow::Result<()> {
    options.json.as_deref().map_or(Ok(()), check_writable)?;
    let measured = measure();
    measured.print();
    write_json(options.json.as_deref(), &measured)
}

fn measure() -> Measured {
    let mut collector = Collector::default();
    let mut lane = collector.recorder(Lane::Cpu);
    let begin = Instant::now();
    let picture = picture(begin);
    let each = |since: Instant| since.elapsed().as_secs_f64() * 1e9 / f64::from(BATCH);
    let mut samples: [Vec<f64>; 6] = std::array::from_fn(|_| Vec::with_capacity(ROUNDS));
    for _ in 0..ROUNDS {
        let [
            clock,
            span,
            until_now,
            pictures,
            collect_span,
            collect_picture,
        ] = &mut samples;
        let since = Instant::now();
        for _ in 0..BATCH {
            black_box(Instant::now());
        }
        clock.push(each(since));

        let since = Instant::now();
        for number in 0..BATCH {
            lane.span(
                Stage::Sort,
                u64::from(number),
                black_box(begin),
                black_box(begin),
            );
        }
        span.push(each(since));
        let since = Instant::now();
        collector.collect();
        collect_span.push(each(since));

        let since = Instant::now();
        for number in 0..BATCH {
            lane.span_until_now(Stage::Sort, u64::from(number), black_box(begin));
        }
        until_now.push(each(since));
        collector.collect();

        let since = Instant::now();
        for _ in 0..BATCH {
            lane.picture(black_box(picture));
        }
        pictures.push(each(since));
        let since = Instant::now();
        collector.collect();
        collect_picture.push(each(since));
    }
    let [
        clock_ns,
        span_ns,
        span_until_now_ns,
        picture_ns,
        collect_span_ns,
        collect_picture_ns,
    ] = samples.map(|samples| median(&samples));
    let spans = DISPLAY_HZ * SPANS_A_PICTURE + MOTION_HZ * SPANS_A_MOTION;
    let ns = spans * (span_until_now_ns + collect_span_ns)
        + DISPLAY_HZ * (picture_ns + collect_picture_ns);
    Measured {
        clock_ns,
        span_ns,
        span_until_now_ns,
        picture_ns,
        collect_span_ns,
        collect_picture_ns,
        event_bytes: size_of::<Event>(),
        events_per_second: spans + DISPLAY_HZ,
        share: ns / 1e9,
    }
}

fn picture(at: Instant) -> PictureTimes {
    let state = FrameTimes {
        number: 1,
        captured: Some(at),
        ..FrameTimes::new(ConcealmentState::Live, at)
    };
    PictureTimes {
        number: 1,
        from: state,
        to: state,
        alpha: 0.5,
        interpolated_for: 1,
        interpolation: [at; 2],
        begun: at,
        sorted: at,
        drawn: at,
        displayed: at,
        predicted: at,
        repeated: false,
        gaussians: 60_000,
        scale: 1.0,
    }
}

impl Measured {
    fn print(&self) {
        println!(
            "Profiling, medians of {ROUNDS} rounds of {BATCH} events of {} bytes\n",
            self.event_bytes
        );
        let row = |what: &str, ns: f64| {
            vec![
                what.to_owned(),
                format!("{ns:.1}"),
                format!("{:.2}", ns / self.clock_ns.max(1e-3)),
            ]
        };
        print_table(
            &["an event", "ns", "of a look at the clock"],
            &[
                row("one look at the clock", self.clock_ns),
                row("a span, its times known", self.span_ns),
                row("a span that ends now", self.span_until_now_ns),
                row("a picture", self.picture_ns),
                row("collecting a span", self.collect_span_ns),
                row("collecting a picture", self.collect_picture_ns),
            ],
        );
        println!(
            "\nAt {DISPLAY_HZ:.0} pictures and {MOTION_HZ:.0} motions a second: {:.0} events, {:.4} % of one core's time.",
            self.events_per_second,
            self.share * 100.0
        );
    }
}
