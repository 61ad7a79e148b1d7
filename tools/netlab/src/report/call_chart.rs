//! All calls in one picture: a lane each, under its condition; latency, bitrate and loss side by side.

use super::{
    CallRow, Report,
    draw::{Anchor, Axis, Canvas, FAINT, GRID, INK, colour, number, pale},
};
use crate::NetlabError;

const WIDTH: f64 = 1240.0;
const MARGIN: f64 = 28.0;
const LANE: f64 = 24.0;
const CONDITION: f64 = 34.0;
const TOP: f64 = 142.0;
const LATENCY: (f64, f64) = (230.0, 700.0);
const BITRATE: (f64, f64) = (740.0, 990.0);
const LOST: (f64, f64) = (1030.0, WIDTH - MARGIN);

enum Lane<'a> {
    Condition(&'a str),
    Call(&'a CallRow, usize),
}

/// Draws the report's calls as an SVG: latency percentiles on a logarithmic axis, bitrates both ways, frames lost.
///
/// # Errors
/// [`NetlabError::Chart`].
pub fn call_chart(report: &Report) -> Result<String, NetlabError> {
    let lanes = lanes(&report.calls);
    let mut bottom = TOP + 8.0;
    let placed: Vec<(f64, &Lane<'_>)> = lanes
        .iter()
        .map(|lane| {
            let height = if matches!(lane, Lane::Condition(_)) {
                CONDITION
            } else {
                LANE
            };
            bottom += height;
            (bottom - LANE / 2.0, lane)
        })
        .collect();
    bottom += 10.0;

    let latencies = report.calls.iter().filter_map(|c| c.latency_ms);
    let latency = Axis::logarithmic(latencies.flat_map(|l| [l.p50, l.p95, l.p99]), LATENCY);
    let most = |of: fn(&CallRow) -> f64| report.calls.iter().map(of).fold(0.0, f64::max);
    // A third more than the longest bar, for the figure behind it.
    let bitrate = Axis::linear(most(|c| c.down_kbit_s + c.up_kbit_s) * 1.4, BITRATE, 4.0);
    let lost = Axis::linear(most(|c| c.frames.lost_percent()).max(1.0) * 1.35, LOST, 4.0);

    let mut svg = String::new();
    let canvas = Canvas::new(&mut svg, WIDTH, bottom + 24.0)?;
    canvas.bold(&report.title, (MARGIN, 34.0), 24.0)?;
    heading(&canvas)?;
    for axis in [&latency, &bitrate, &lost] {
        for &tick in &axis.ticks {
            let x = axis.at(tick);
            canvas.line(&[(x, TOP), (x, bottom)], 1, GRID)?;
            canvas.text(&number(tick), (x, TOP - 12.0), 14.0, Anchor::Middle, FAINT)?;
        }
    }
    for (y, lane) in placed {
        match lane {
            Lane::Condition(name) => canvas.bold(name, (MARGIN, y), 17.0)?,
            Lane::Call(call, variant) => {
                let ink = colour(*variant);
                canvas.text(
                    &call.variant(),
                    (LATENCY.0 - 16.0, y),
                    15.0,
                    Anchor::Right,
                    INK,
                )?;
                draw_latency(&canvas, call, &latency, y, ink)?;
                draw_bitrate(&canvas, call, &bitrate, y, ink)?;
                let percent = call.frames.lost_percent();
                canvas.bar((LOST.0, lost.at(percent)), y, LANE * 0.55, ink)?;
                let figure = format!("{percent:.2}");
                canvas.text(
                    &figure,
                    (lost.at(percent) + 6.0, y),
                    14.0,
                    Anchor::Left,
                    INK,
                )?;
            }
        }
    }
    canvas.finish()?;
    Ok(svg)
}

/// The calls under their conditions, each with the number of its variant, which is its colour.
fn lanes(calls: &[CallRow]) -> Vec<Lane<'_>> {
    let mut variants: Vec<String> = Vec::new();
    let mut lanes = Vec::new();
    let mut previous = None;
    for call in calls {
        if previous != Some(&call.condition) {
            lanes.push(Lane::Condition(&call.condition));
            previous = Some(&call.condition);
        }
        let name = call.variant();
        let variant = variants.iter().position(|v| *v == name);
        let variant = variant.unwrap_or_else(|| {
            variants.push(name);
            variants.len() - 1
        });
        lanes.push(Lane::Call(call, variant));
    }
    lanes
}

fn heading(canvas: &Canvas<'_>) -> Result<(), NetlabError> {
    let y = 82.0;
    let key = 104.0;
    canvas.bold(
        "Latency, capture to deform stage (ms)",
        (LATENCY.0, y),
        16.0,
    )?;
    let (p50, p95, p99) = (LATENCY.0 + 6.0, LATENCY.0 + 76.0, LATENCY.0 + 146.0);
    canvas.dot((p50, key), FAINT)?;
    canvas.text("p50", (p50 + 12.0, key), 14.0, Anchor::Left, FAINT)?;
    canvas.ring((p95, key), FAINT)?;
    canvas.text("p95", (p95 + 12.0, key), 14.0, Anchor::Left, FAINT)?;
    canvas.end((p99, key), FAINT)?;
    canvas.text("p99", (p99 + 10.0, key), 14.0, Anchor::Left, FAINT)?;
    canvas.bold("Bitrate with headers (kbit/s)", (BITRATE.0, y), 16.0)?;
    canvas.bar((BITRATE.0, BITRATE.0 + 14.0), key, 12.0, FAINT)?;
    canvas.text(
        "to the viewer",
        (BITRATE.0 + 20.0, key),
        14.0,
        Anchor::Left,
        FAINT,
    )?;
    canvas.bar(
        (BITRATE.0 + 124.0, BITRATE.0 + 138.0),
        key,
        12.0,
        pale(FAINT),
    )?;
    canvas.text("back", (BITRATE.0 + 144.0, key), 14.0, Anchor::Left, FAINT)?;
    canvas.bold("Frames lost (%)", (LOST.0, y), 16.0)
}

fn draw_latency(
    canvas: &Canvas<'_>,
    call: &CallRow,
    axis: &Axis,
    y: f64,
    ink: plotters::style::RGBColor,
) -> Result<(), NetlabError> {
    let Some(latency) = call.latency_ms else {
        return canvas.text(
            "nothing came",
            (LATENCY.0 + 8.0, y),
            14.0,
            Anchor::Left,
            FAINT,
        );
    };
    let [p50, p95, p99] = [latency.p50, latency.p95, latency.p99].map(|ms| axis.at(ms));
    canvas.line(&[(p50, y), (p99, y)], 2, ink)?;
    canvas.end((p99, y), ink)?;
    canvas.ring((p95, y), ink)?;
    canvas.dot((p50, y), ink)
}

fn draw_bitrate(
    canvas: &Canvas<'_>,
    call: &CallRow,
    axis: &Axis,
    y: f64,
    ink: plotters::style::RGBColor,
) -> Result<(), NetlabError> {
    let down = axis.at(call.down_kbit_s);
    let both = axis.at(call.down_kbit_s + call.up_kbit_s);
    canvas.bar((axis.at(0.0), down), y, LANE * 0.55, ink)?;
    canvas.bar((down, both), y, LANE * 0.55, pale(ink))?;
    let figure = format!("{:.1} + {:.1}", call.down_kbit_s, call.up_kbit_s);
    canvas.text(&figure, (both + 6.0, y), 14.0, Anchor::Left, INK)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::samples;

    #[test]
    fn every_call_has_its_lane_and_figures() {
        let report = samples::report();
        let svg = call_chart(&report).expect("a chart");
        if let Ok(folder) = std::env::var("NETLAB_CHARTS") {
            std::fs::write(format!("{folder}/calls.svg"), &svg).expect("written");
        }
        let count = |text: &str| svg.matches(text).count();
        assert_eq!(count("compact, unreliable"), 4, "a lane a condition");
        for condition in ["clean", "1 % lost", "5 % lost", "0.2 Mbit/s"] {
            assert_eq!(count(&format!("\n{condition}\n")), 1, "{condition}");
        }
        assert_eq!(
            count("112.4 + 28.3"),
            2,
            "paper's bitrate where it is clean"
        );
    }

    #[test]
    fn an_empty_report_and_one_with_nan_are_drawn_too() {
        let mut report = samples::report();
        report.calls[0].latency_ms = None;
        report.calls[1].down_kbit_s = f64::NAN;
        report.calls[2].down_kbit_s = f64::INFINITY;
        assert!(call_chart(&report).is_ok(), "of nonsense");
        assert!(call_chart(&Report::default()).is_ok(), "of nothing");
    }
}
