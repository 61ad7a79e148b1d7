//! What a call came to, as a table for people and as JSON for programs.

use super::Fetched;
use crate::screen::Watched;
use app_pipeline::profile::Percentiles;
use app_session::call::CallFigures;
use app_session::headset::HeadsetFigures;
use profile_report::AvatarFigures;
use serde::Serialize;
use std::path::PathBuf;

/// Everything `receive` prints.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    avatar: AvatarFigures,
    download: Download,
    call: CallFigures,
    #[serde(skip_serializing_if = "Option::is_none")]
    drawing: Option<Watched>,
    /// The headset that showed it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) headset: Option<HeadsetFigures>,
    /// Who else was there.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) others: Vec<Other>,
    pictures: Vec<PathBuf>,
}

/// Another person in the same room.
#[derive(Debug, Serialize)]
pub(super) struct Other {
    pub(super) avatar: AvatarFigures,
    pub(super) call: CallFigures,
}

/// How the avatar came here.
#[derive(Debug, Serialize)]
struct Download {
    /// Bytes that crossed the network: none where the cache had it.
    bytes: u64,
    seconds: f64,
}

impl Report {
    pub(super) fn new(
        avatar: AvatarFigures,
        package: &Fetched,
        call: CallFigures,
        shown: Option<Watched>,
    ) -> Self {
        Self {
            avatar,
            download: Download {
                bytes: package.downloaded,
                seconds: package.seconds,
            },
            call,
            pictures: shown
                .as_ref()
                .map_or_else(Vec::new, |shown| shown.pictures.clone()),
            drawing: shown,
            headset: None,
            others: Vec::new(),
        }
    }

    pub(super) fn print(&self) {
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
            "call     {:.1} s of {} on the {} channel at {} Hz: {} frames taken, {} lost, {} late, {:.1} kbit/s of payload",
            call.live_seconds,
            call.announced.codec,
            call.announced.channel,
            call.announced.rate_hz,
            call.released,
            call.lost,
            call.late,
            call.payload_kbit_s
        );
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
        for Other { avatar, call } in &self.others {
            println!(
                "also     {}: {} Gaussians; {:.1} s, {} frames taken, {} lost",
                avatar.name, avatar.gaussians, call.live_seconds, call.released, call.lost
            );
        }
        if let Some(headset) = &self.headset {
            print_headset(headset);
        }
        if let Some(drawing) = &self.drawing {
            drawing.print();
        }
        if !self.pictures.is_empty() {
            println!("\npictures");
            for picture in &self.pictures {
                println!("  {}", picture.display());
            }
        }
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
        "           floor: {}; behind: {}; depth: {}; hands: {}; gaze: {}",
        headset.floor,
        headset.surround,
        yes(headset.depth),
        yes(headset.hands),
        yes(headset.gaze)
    );
    if let Some(way) = &headset.way {
        println!("           pictures are {way}");
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
