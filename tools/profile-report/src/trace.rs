//! A recording as a trace: JSON in the Trace Event Format, which ui.perfetto.dev and chrome://tracing open.
//!
//! One track for each lane, and one for the display. Arrows lead from a motion frame's first stage to its state of
//! Gaussians, and from there to each picture that was made from it. Written event by event.

use crate::machine::MachineFigures;
use app_pipeline::profile::{PictureLatency, PictureTimes, Recording, Span, Terms, nanoseconds};
use app_pipeline::stage::{Lane, Stage};
use serde::Serialize;
use std::collections::HashMap;
use std::io::{self, Write};
use std::time::Instant;

/// The one process. No track has its number: that one would be shown as the main thread.
const PROCESS: u32 = 10;
/// The display's track, below the lanes'.
const DISPLAY: usize = Lane::ALL.len() + 1;
/// What "a second" is in pictures a second.
const SECOND_NS: i64 = 1_000_000_000;

/// One event. What does not apply is left out.
#[derive(Debug, Default, Serialize)]
struct Event<'a> {
    name: &'a str,
    #[serde(skip_serializing_if = "str::is_empty")]
    cat: &'a str,
    ph: &'a str,
    pid: u32,
    tid: usize,
    /// Microseconds since the measuring began.
    #[serde(skip_serializing_if = "Option::is_none")]
    ts: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dur: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<u64>,
    /// Of an instant: its track alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    s: Option<&'a str>,
    /// Of an arrow's end: the slice around it, not the next one.
    #[serde(skip_serializing_if = "Option::is_none")]
    bp: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    args: Option<Arguments>,
}

/// The arguments that the trace viewer shows of a selected event.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Arguments {
    Span {
        frame: u64,
        unit: app_pipeline::stage::Unit,
    },
    Picture {
        picture: u64,
        interpolated_for: u64,
        states: [u64; 2],
        place_between: f32,
        repeated: bool,
        gaussians: u32,
        scale: f32,
        latency_ms: f64,
    },
    Other(serde_json::Value),
}

/// Writes `recording`; `about` describes the measurement to the reader of the file.
pub(crate) fn write(
    out: impl Write,
    recording: &Recording,
    terms: &Terms,
    machine: &MachineFigures,
    about: &serde_json::Value,
) -> io::Result<()> {
    let mut trace = Trace {
        out,
        // A span that had begun before measuring is shown whole.
        begin: recording
            .spans
            .first()
            .map_or(recording.begin, |first| first.begin.min(recording.begin)),
        is_first: true,
    };
    write!(trace.out, "{{\"displayTimeUnit\":\"ms\",\"otherData\":")?;
    serde_json::to_writer(&mut trace.out, about)?;
    write!(trace.out, ",\"traceEvents\":[")?;
    trace.tracks()?;
    for span in &recording.spans {
        trace.span(span, terms)?;
    }
    trace.arrows(recording)?;
    for picture in &recording.pictures {
        trace.picture(picture, terms)?;
    }
    trace.rate(recording)?;
    trace.machine(recording, machine)?;
    writeln!(trace.out, "\n]}}")
}

struct Trace<W> {
    out: W,
    begin: Instant,
    is_first: bool,
}

impl<W: Write> Trace<W> {
    fn put(&mut self, event: &Event<'_>) -> io::Result<()> {
        self.out
            .write_all(if self.is_first { b"\n" } else { b",\n" })?;
        self.is_first = false;
        Ok(serde_json::to_writer(&mut self.out, event)?)
    }

    fn us(&self, at: Instant) -> f64 {
        nanoseconds(self.begin, at) as f64 / 1e3
    }

    fn tracks(&mut self) -> io::Result<()> {
        let lanes = Lane::ALL.map(|lane| (track(lane), lane.name()));
        let named = |name, tid, args| Event {
            name,
            ph: "M",
            pid: PROCESS,
            tid,
            args: Some(Arguments::Other(args)),
            ..Event::default()
        };
        self.put(&named(
            "process_name",
            0,
            serde_json::json!({ "name": "mon3tr" }),
        ))?;
        for (tid, name) in lanes.into_iter().chain([(DISPLAY, "display")]) {
            self.put(&named(
                "thread_name",
                tid,
                serde_json::json!({ "name": name }),
            ))?;
            let order = serde_json::json!({ "sort_index": tid });
            self.put(&named("thread_sort_index", tid, order))?;
        }
        Ok(())
    }

    fn span(&mut self, span: &Span, terms: &Terms) -> io::Result<()> {
        self.put(&Event {
            name: span.stage.name(),
            cat: if span.stage.is_per_picture() {
                "picture"
            } else {
                "motion"
            },
            ph: "X",
            pid: PROCESS,
            tid: track(span.lane),
            ts: Some(self.us(span.begin)),
            dur: Some(nanoseconds(span.begin, span.end) as f64 / 1e3),
            args: Some(Arguments::Span {
                frame: span.frame,
                unit: terms.unit_of(span.stage),
            }),
            ..Event::default()
        })
    }

    fn arrows(&mut self, recording: &Recording) -> io::Result<()> {
        let slices = Slices::new(&recording.spans);
        let mut id = 0;
        let frames = recording
            .spans
            .iter()
            .filter(|span| !span.stage.is_per_picture());
        let mut frames: Vec<u64> = frames.map(|span| span.frame).collect();
        frames.sort_unstable();
        frames.dedup();
        for frame in frames {
            let way = slices.of_motion(frame);
            self.arrow(&mut id, "motion frame", way)?;
        }
        for picture in &recording.pictures {
            let drawn = slices.of_picture(picture);
            let state = |number| slices.of_motion(number).last();
            let [from, to] = [picture.from.number, picture.to.number];
            let whole_way = state(to).into_iter().chain(drawn.clone());
            self.arrow(&mut id, "state to picture", whole_way)?;
            if from != to {
                let first = state(from).into_iter().chain(drawn.take(1));
                self.arrow(&mut id, "older state to picture", first)?;
            }
        }
        Ok(())
    }

    /// One arrow through the middles of `way`, if it has two ends at least.
    fn arrow<'a>(
        &mut self,
        id: &mut u64,
        name: &str,
        way: impl Iterator<Item = &'a Span>,
    ) -> io::Result<()> {
        let way: Vec<&Span> = way.collect();
        let [_, .., last] = way.as_slice() else {
            return Ok(());
        };
        *id += 1;
        for (k, span) in way.iter().enumerate() {
            let is_last = std::ptr::eq(*span, *last);
            let middle = span.begin + span.end.saturating_duration_since(span.begin) / 2;
            self.put(&Event {
                name,
                cat: "way",
                ph: match k {
                    0 => "s",
                    _ if is_last => "f",
                    _ => "t",
                },
                pid: PROCESS,
                tid: track(span.lane),
                ts: Some(self.us(middle)),
                id: Some(*id),
                bp: is_last.then_some("e"),
                ..Event::default()
            })?;
        }
        Ok(())
    }

    fn picture(&mut self, picture: &PictureTimes, terms: &Terms) -> io::Result<()> {
        let ts = Some(self.us(picture.displayed));
        let latency = PictureLatency::new(picture, terms.encode).whole();
        let latency_ms = latency as f64 / 1e6;
        self.put(&Event {
            name: "vertical blank",
            cat: "display",
            ph: "i",
            pid: PROCESS,
            tid: DISPLAY,
            ts,
            s: Some("t"),
            args: Some(Arguments::Picture {
                picture: picture.number,
                interpolated_for: picture.interpolated_for,
                states: [picture.from.number, picture.to.number],
                place_between: picture.alpha,
                repeated: picture.repeated,
                gaussians: picture.gaussians,
                scale: picture.scale,
                latency_ms,
            }),
            ..Event::default()
        })?;
        self.counter(
            "capture to display",
            ts,
            serde_json::json!({ "ms": latency_ms }),
        )
    }

    /// Pictures of the second before, at each.
    fn rate(&mut self, recording: &Recording) -> io::Result<()> {
        let shown: Vec<Instant> = recording.pictures.iter().map(|one| one.displayed).collect();
        let mut oldest = 0;
        for (k, at) in shown.iter().enumerate() {
            // Until a whole second has been seen the figure would only tell that.
            if nanoseconds(recording.begin, *at) < SECOND_NS {
                continue;
            }
            while shown
                .get(oldest)
                .is_some_and(|one| nanoseconds(*one, *at) >= SECOND_NS)
            {
                oldest += 1;
            }
            let rate = serde_json::json!({ "pictures": k + 1 - oldest });
            self.counter("pictures a second", Some(self.us(*at)), rate)?;
        }
        Ok(())
    }

    /// Heat and clocks, as counters.
    fn machine(&mut self, recording: &Recording, machine: &MachineFigures) -> io::Result<()> {
        let begun = self.us(recording.begin);
        for series in &machine.series {
            let unit = if series.unit.is_empty() {
                "level"
            } else {
                series.unit
            };
            for (at_s, value) in machine.at_s.iter().zip(&series.values) {
                let Some(value) = value else { continue };
                let args = serde_json::json!({ unit: value });
                self.counter(&series.channel.name, Some(begun + at_s * 1e6), args)?;
            }
        }
        Ok(())
    }

    fn counter(&mut self, name: &str, ts: Option<f64>, args: serde_json::Value) -> io::Result<()> {
        self.put(&Event {
            name,
            ph: "C",
            pid: PROCESS,
            ts,
            args: Some(Arguments::Other(args)),
            ..Event::default()
        })
    }
}

fn track(lane: Lane) -> usize {
    lane as usize + 1
}

/// Where the spans of each stage and frame are: the first and the last, where it was done in slices.
struct Slices<'a>(HashMap<(Stage, u64), [&'a Span; 2]>);

impl<'a> Slices<'a> {
    fn new(spans: &'a [Span]) -> Self {
        let mut slices: HashMap<_, [&Span; 2]> = HashMap::with_capacity(spans.len());
        for span in spans {
            slices
                .entry((span.stage, span.frame))
                .and_modify(|[_, last]| *last = span)
                .or_insert([span; 2]);
        }
        Self(slices)
    }

    /// A motion frame's spans, in order.
    fn of_motion(&self, frame: u64) -> impl Iterator<Item = &'a Span> + Clone {
        let stages = Stage::ALL
            .into_iter()
            .filter(|stage| !stage.is_per_picture());
        self.of(stages, frame).map(|[_, last]| last)
    }

    /// A picture's spans: the interpolation that made its Gaussians, and the first thing done for it after that.
    fn of_picture(&self, picture: &PictureTimes) -> impl Iterator<Item = &'a Span> + Clone {
        let mut stages = Stage::ALL
            .into_iter()
            .filter(|stage| *stage > Stage::Interpolate);
        let made = (self.0).get(&(Stage::Interpolate, picture.interpolated_for));
        let drawn = stages.find_map(|stage| self.0.get(&(stage, picture.number)));
        made.into_iter().chain(drawn).map(|[first, _]| *first)
    }

    fn of(
        &self,
        stages: impl Iterator<Item = Stage> + Clone,
        frame: u64,
    ) -> impl Iterator<Item = [&'a Span; 2]> + Clone {
        let found: Vec<_> = stages
            .filter_map(|stage| self.0.get(&(stage, frame)).copied())
            .collect();
        found.into_iter()
    }
}
