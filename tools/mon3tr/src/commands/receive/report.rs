//! What a call came to, as a table for people and as JSON for programs.

use super::people::{Arrival, Download};
use super::screen::{Drawn, Shown};
use crate::gaze::{GazeFigures, GazeToFigures};
use crate::report::Splatting;
use crate::size::Size;
use anyhow::anyhow;
use app_pipeline::error::ReceiverError;
use app_pipeline::lanes::LeftOut;
use app_pipeline::profile::Percentiles;
use app_session::call::{CallEnd, CallFigures, CallWatch};
use app_session::headset::HeadsetFigures;
use app_session::participant::CallReport;
use profile_report::{AvatarFigures, Measured, SessionTerms};
use serde::Serialize;
use std::path::PathBuf;

/// What a viewer reads whose sender has another avatar now.
const CAME_BACK: &str = "the sender has come back with another avatar: join again to see it";

/// What a viewer reads who was never let in.
const NEVER_JOINED: &str = "it never began";

/// Everything `receive` prints.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    /// What the first person is called, where people have names.
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    avatar: AvatarFigures,
    download: Download,
    call: CallFigures,
    /// Why pictures were drawn without the first person.
    #[serde(skip_serializing_if = "Option::is_none")]
    left_out: Option<LeftOut>,
    #[serde(skip_serializing_if = "Option::is_none")]
    drawing: Option<Drawing>,
    /// The headset that showed it.
    #[serde(skip_serializing_if = "Option::is_none")]
    headset: Option<HeadsetFigures>,
    /// The people beside the first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    others: Vec<Other>,
    pictures: Vec<PathBuf>,
}

/// Another person in the same session.
#[derive(Debug, Serialize)]
struct Other {
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    avatar: AvatarFigures,
    download: Download,
    call: CallFigures,
    #[serde(skip_serializing_if = "Option::is_none")]
    left_out: Option<LeftOut>,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    shown: Option<Measured>,
}

/// What pictures came to.
#[derive(Debug, Serialize)]
struct Drawing {
    views: u32,
    width: u32,
    height: u32,
    splatting: Splatting,
    #[serde(skip_serializing_if = "Option::is_none")]
    gaze: Option<GazeFigures>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gaze_to: Option<GazeToFigures>,
    /// Of the first person.
    #[serde(flatten)]
    shown: Measured,
}

impl Drawing {
    /// The tables that `profile` prints.
    fn print(&self) {
        let of = &self.shown.measured;
        let eyes = if self.views == 2 { "2 x " } else { "" };
        println!(
            "\npictures   {eyes}{} x {} pixels for a display of {:.0} Hz, the last {:.1} s",
            self.width, self.height, of.display_hz, of.seconds
        );
        println!("splatting  {}", self.splatting);
        if let Some(gaze) = &self.gaze {
            println!("{}", gaze.line());
        }
        if let Some(gaze) = &self.gaze_to {
            println!("{}", gaze.line());
        }
        print_measured(&self.shown);
    }
}

fn print_measured(measured: &Measured) {
    for line in measured.tables() {
        println!("{line}");
    }
    println!();
    for line in measured.totals() {
        println!("{line}");
    }
}

impl Report {
    /// Of these people, and whether it came to a good end: if all people's calls failed, the last one's trouble is an error. Nothing where none of them was
    /// joined.
    pub(crate) fn new(arrivals: &[Arrival], shown: Shown) -> (Option<Self>, anyhow::Result<()>) {
        let (drawn, calls) = match shown {
            Shown::Undrawn(calls) => {
                let ended = |call: CallReport| Ended {
                    watch: Some(call.watch.clone()),
                    call: Some(call),
                    error: None,
                    left_out: None,
                    measured: None,
                };
                (None, calls.into_iter().map(ended).collect())
            }
            Shown::Drawn(drawn) => split(*drawn),
        };
        let count = calls.len();
        let (mut told, mut failed) = (Vec::new(), Vec::new());
        for (number, ended) in calls.into_iter().enumerate() {
            failed.extend(
                ended
                    .error
                    .map(|error| (number, anyhow::Error::from(error))),
            );
            let of = |arrival: &&Arrival| {
                let watch = ended.watch.as_ref();
                watch.is_some_and(|watch| watch.is_same(&arrival.watch))
            };
            let (Some(CallReport { figures, end, .. }), Some(person)) =
                (ended.call, arrivals.iter().find(of))
            else {
                continue;
            };
            match end {
                Some(CallEnd::Failed(error)) => failed.push((number, error.into())),
                Some(CallEnd::AnotherAvatar(_)) => failed.push((number, anyhow!(CAME_BACK))),
                Some(CallEnd::HungUp) => {}
                // This side left before it was let in.
                None => {
                    let why = figures.received.not_joined.as_ref();
                    let why = why.filter(|_| figures.received.sessions == 0);
                    failed.extend(why.map(|why| (number, anyhow!("{NEVER_JOINED}: {why}"))));
                }
            }
            told.push((person.clone(), figures, ended.measured, ended.left_out));
        }
        failed.dedup_by_key(|(number, _)| *number);
        let all_failed = count > 0 && failed.len() == count;
        let last = failed.pop_if(|_| all_failed);
        let last = last.map(|(_, error): (_, anyhow::Error)| error.context("the call ended"));
        for (number, error) in failed {
            log::warn!("person {number}'s call ended: {error:#}");
        }
        let mut told = told.into_iter();
        let outcome = last.map_or(Ok(()), Err);
        let Some((first, call, measured, left_out)) = told.next() else {
            return (None, outcome);
        };
        let others = told.map(|(person, call, shown, left_out)| Other {
            name: person.name,
            avatar: person.figures,
            download: person.download,
            call,
            left_out,
            shown,
        });
        let mut report = Self {
            name: first.name,
            avatar: first.figures,
            download: first.download,
            call,
            left_out,
            drawing: None,
            headset: None,
            others: others.collect(),
            pictures: Vec::new(),
        };
        if let Some((drawn, shown)) = drawn.zip(measured) {
            report.pictures = drawn.pictures;
            report.headset = drawn.headset;
            report.drawing = Some(Drawing {
                views: drawn.views,
                width: drawn.size.width,
                height: drawn.size.height,
                splatting: drawn.splatting,
                gaze: drawn.gaze,
                gaze_to: drawn.gaze_to,
                shown,
            });
        }
        (Some(report), outcome)
    }

    /// A line for each person.
    pub(crate) fn print_people(&self) {
        let others = (self.others.iter()).map(|other| (&other.name, &other.call));
        for (name, call) in std::iter::once((&self.name, &self.call)).chain(others) {
            let ear = call.latency.mouth_to_ear.as_ref();
            let ear = ear.map_or_else(String::new, |ear| {
                format!(", mouth to ear {:.0} ms", ear.p50_ms)
            });
            let path = call.received.path.as_ref();
            let path = path.map_or_else(String::new, |path| format!("; {path}"));
            println!(
                "{}: {:.1} s, {} motions taken, {} lost, {:.1} s without motion{ear}{path}",
                name.as_deref().unwrap_or("someone"),
                call.live_seconds,
                call.released,
                call.lost,
                call.seconds_without_motion,
            );
        }
    }

    pub(crate) fn print(&self) {
        let (call, a) = (&self.call, &self.avatar);
        println!(
            "\navatar   {}: {} Gaussians, {:.1} MB, {}",
            a.name,
            a.gaussians,
            a.package_bytes as f64 / 1e6,
            if self.download.bytes == 0 {
                "from the cache".to_owned()
            } else {
                format!("fetched in {:.2} s", self.download.seconds)
            }
        );
        println!(
            "call     {:.1} s of {} on the {} channel at {} Hz: {} frames taken, {} lost, {} late, {:.1} s without motion, {:.1} kbit/s of payload",
            call.live_seconds,
            call.announced.codec,
            call.announced.channel,
            call.announced.rate_hz,
            call.released,
            call.lost,
            call.late,
            call.seconds_without_motion,
            call.payload_kbit_s
        );
        if let Some(voice) = &call.voice {
            println!(
                "voice    {} frames of 20 ms heard, {} recovered from the next one, {} concealed ({} in a row at most), {:.1} kbit/s of payload",
                voice.decoded,
                voice.recovered,
                voice.concealed,
                voice.longest_gap,
                call.received.voice_bytes as f64 * 8e-3 / call.live_seconds.max(1e-3)
            );
        }
        if call.received.refused.total() > 0 {
            println!("refused  {}", call.received.refused);
        }
        println!(
            "\n{:<44} {:>8} {:>8} {:>8} {:>8}",
            "milliseconds", "p50", "p95", "p99", "max"
        );
        let latency = &call.latency;
        for (what, times) in [
            ("network (capture to arrival)", latency.network),
            (
                "hand-over (arrived and due to deform stage)",
                latency.hand_over,
            ),
            ("added: both of these", latency.added),
            ("held by the jitter buffer", latency.jitter_buffer),
            (
                "capture to deform stage, all told",
                latency.capture_to_deform,
            ),
            ("mouth to ear", latency.mouth_to_ear),
            ("heard and seen apart", latency.voice_apart),
        ] {
            let Some(Percentiles {
                p50_ms,
                p95_ms,
                p99_ms,
                max_ms,
                ..
            }) = times
            else {
                continue;
            };
            println!("{what:<44} {p50_ms:>8.2} {p95_ms:>8.2} {p99_ms:>8.2} {max_ms:>8.2}");
        }
        if let Some(round_trip) = call.received.round_trip_us {
            println!(
                "{:<44} {:>8.2}",
                "shortest round trip",
                round_trip as f64 / 1e3
            );
        }
        for gap in call.gaps.iter().take(5) {
            println!(
                "nothing came for {:.1} s, {:.1} s into the call",
                gap.ms / 1e3,
                gap.at_s
            );
        }
        if let Some(headset) = &self.headset {
            print_headset(headset);
        }
        if let Some(drawing) = &self.drawing {
            drawing.print();
        }
        print_left_out(self.left_out);
        for Other {
            avatar,
            call,
            left_out,
            shown,
            ..
        } in &self.others
        {
            println!(
                "\nalso     {}: {} Gaussians; {:.1} s, {} frames taken, {} lost, {:.1} s without motion",
                avatar.name,
                avatar.gaussians,
                call.live_seconds,
                call.released,
                call.lost,
                call.seconds_without_motion
            );
            if let Some(shown) = shown {
                print_measured(shown);
            }
            print_left_out(*left_out);
        }
        if !self.pictures.is_empty() {
            println!("\npictures");
            for picture in &self.pictures {
                println!("  {}", picture.display());
            }
        }
    }
}

/// What pictures came to beside what each person's lanes measured.
struct Pictures {
    pictures: Vec<PathBuf>,
    headset: Option<HeadsetFigures>,
    gaze: Option<GazeFigures>,
    gaze_to: Option<GazeToFigures>,
    views: u32,
    size: Size,
    splatting: Splatting,
}

/// A person's part of a session.
struct Ended {
    watch: Option<CallWatch>,
    call: Option<CallReport>,
    error: Option<ReceiverError>,
    /// Why pictures were drawn without them.
    left_out: Option<LeftOut>,
    /// Where a picture was drawn.
    measured: Option<Measured>,
}

fn split(drawn: Drawn) -> (Option<Pictures>, Vec<Ended>) {
    let session = drawn.session;
    let measured: Vec<_> = (session.people.iter())
        .map(|person| {
            let terms = SessionTerms {
                time: [drawn.first?, session.ended],
                display_period: drawn.display_period,
                motion_hz: person.call.as_ref()?.figures.announced.rate_hz,
                encode: None,
            };
            Some(Measured::of(&session, person, &terms))
        })
        .collect();
    let pictures = Pictures {
        pictures: drawn.pictures,
        headset: drawn.headset,
        gaze: drawn.gaze,
        gaze_to: drawn.gaze_to,
        views: drawn.views,
        size: drawn.size,
        splatting: Splatting::new(session.back_end, session.back_end_trial),
    };
    let ended = (session.people.into_iter().zip(measured)).map(|(person, measured)| Ended {
        watch: person.watch,
        call: person.call,
        error: person.error,
        left_out: person.left_out,
        measured,
    });
    (Some(pictures), ended.collect())
}

fn print_left_out(left_out: Option<LeftOut>) {
    if let Some(LeftOut {
        pictures, pairs, ..
    }) = left_out
    {
        println!(
            "left out of {pictures} pictures, where their Gaussians would cover {pairs} screen tiles"
        );
    }
}

fn print_headset(headset: &HeadsetFigures) {
    let [width, height] = headset.eye_size;
    let frames = &headset.frames;
    println!(
        "\nheadset    {} of {}, 2 x {width} x {height} pixels, drawn by {}",
        headset.headset, headset.runtime, headset.device
    );
    println!(
        "           floor: {}; behind: {}; depth: {}; hands: {}; foveation follows gaze: {}",
        headset.floor,
        headset.surround,
        yes(headset.depth),
        yes(headset.hands),
        yes(headset.foveation_follows_gaze)
    );
    if let Some(way) = &headset.way {
        println!("           pictures are {way}");
    }
    if let Some([left, right]) = headset.lenses_show {
        println!(
            "           the lenses show {:.0} % of the left picture and {:.0} % of the right one; the rest is not drawn",
            100.0 * left,
            100.0 * right
        );
    }
    println!("states     {}", headset.states.join(" "));
    println!("granted    {}", headset.granted.join(" "));
    println!("missing    {}", headset.missing.join(" "));
    if headset.opened > 1 {
        println!(
            "opened     {} times: its runtime went and came back",
            headset.opened
        );
    }
    println!(
        "frames     {} shown ({} before anybody was there), {} paced but not to be seen, {} refreshes late",
        frames.shown, frames.empty, frames.unseen, frames.late
    );
    for (what, times) in [
        ("predicted display times apart, ms", frames.interval),
        ("the display's period as predicted, ms", frames.period),
    ] {
        if let Some(times) = times {
            println!(
                "           {what:<38} p50 {:.1}, p95 {:.1}, max {:.1}",
                times.p50_ms, times.p95_ms, times.max_ms
            );
        }
    }
}

fn yes(is: bool) -> &'static str {
    if is { "yes" } else { "no" }
}
