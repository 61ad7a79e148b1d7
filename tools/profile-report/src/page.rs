//! One HTML file that shows a recording: timeline, latency, distributions, figures. It makes no requests.

use crate::Report;
use app_pipeline::profile::{FrameTimes, Part, PictureLatency, Recording, Terms, nanoseconds};
use app_pipeline::stage::{Lane, Stage};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::Instant;

const HTML: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Most spans drawn, the newest: about 25 bytes each.
const MOST_SPANS: usize = 28_000;
/// Most pictures drawn, the newest: about 120 bytes each.
const MOST_PICTURES: usize = 4_000;

/// The page.
pub(crate) fn page(
    report: &Report,
    recording: &Recording,
    terms: &Terms,
) -> serde_json::Result<String> {
    let data = json!({ "report": report, "recorded": recorded(recording, terms) });
    let data = serde_json::to_string(&data)?;
    // What is in it (an avatar's name, say) must not end the script.
    let data = data.replace('<', "\\u003c");
    Ok(HTML
        .replace("/*STYLE*/", STYLE)
        .replace("/*SCRIPT*/", SCRIPT)
        .replace("/*DATA*/", &data))
}

/// The recording in columns, times in microseconds since the measuring began.
fn recorded(recording: &Recording, terms: &Terms) -> Value {
    let us = |at: Instant| nanoseconds(recording.begin, at) / 1000;
    let spans = newest(&recording.spans, MOST_SPANS);
    let pictures = newest(&recording.pictures, MOST_PICTURES);
    // Each once: a state is in several pictures.
    let mut states: BTreeMap<u64, &FrameTimes> = BTreeMap::new();
    for picture in pictures {
        states.extend([&picture.from, &picture.to].map(|state| (state.number, state)));
    }
    let state = |s: &&FrameTimes| {
        let [inference, deformed] = s.inference.map(us);
        json!([
            s.number,
            s.captured.map(us),
            us(s.arrived),
            us(s.released),
            inference,
            deformed,
            us(s.ready),
            s.source
        ])
    };
    let picture = |p: &app_pipeline::profile::PictureTimes| {
        let parts = PictureLatency::new(p, terms.encode).parts;
        json!([
            p.number,
            p.from.number,
            p.to.number,
            (f64::from(p.alpha) * 1e3).round() / 1e3,
            us(p.displayed),
            u8::from(p.repeated),
            u8::from(
                nanoseconds(p.predicted, p.displayed) as f64 / 1e9
                    > 0.5 * terms.display_period.as_secs_f64()
            ),
            p.gaussians,
            p.scale,
            parts.map(|ns| ns / 1000),
            p.interpolated_for
        ])
    };
    json!({
        "lanes": Lane::ALL.map(Lane::name),
        "stages": Stage::ALL.map(|stage| json!([stage.name(), stage.is_per_picture(), terms.unit_of(stage)])),
        "parts": Part::ALL.map(Part::name),
        "left_out": [recording.spans.len() - spans.len(), recording.pictures.len() - pictures.len()],
        "end": us(recording.end),
        "period": terms.display_period.as_secs_f64() * 1e6,
        "spans": {
            "lane": spans.iter().map(|s| s.lane as usize).collect::<Vec<_>>(),
            "stage": spans.iter().map(|s| s.stage as usize).collect::<Vec<_>>(),
            "frame": spans.iter().map(|s| s.frame).collect::<Vec<_>>(),
            "begin": spans.iter().map(|s| us(s.begin)).collect::<Vec<_>>(),
            "takes": spans.iter().map(|s| nanoseconds(s.begin, s.end) / 1000).collect::<Vec<_>>(),
        },
        "states": states.values().map(state).collect::<Vec<_>>(),
        "pictures": pictures.iter().map(picture).collect::<Vec<_>>(),
    })
}

fn newest<T>(all: &[T], most: usize) -> &[T] {
    all.split_at(all.len().saturating_sub(most)).1
}
