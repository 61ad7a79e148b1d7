//! Bitrates over time as lines, each named at its end.

use super::{
    Report,
    draw::{Anchor, Axis, Canvas, FAINT, GRID, INK, colour, number},
};
use crate::NetlabError;

const WIDTH: f64 = 1240.0;
const HEIGHT: f64 = 470.0;
const PLOT: [f64; 4] = [84.0, 96.0, 1020.0, 410.0];
const LABEL: f64 = 20.0;

/// Draws the report's bitrates over time as an SVG.
///
/// # Errors
/// [`NetlabError::Chart`].
pub fn bitrate_chart(report: &Report) -> Result<String, NetlabError> {
    let [left, top, right, bottom] = PLOT;
    let series = &report.bitrates;
    let longest = series.iter().map(|s| s.kbit_s.len()).max().unwrap_or(0);
    let all = series.iter().flat_map(|s| &s.kbit_s);
    let time = Axis::linear(longest.saturating_sub(1) as f64, (left, right), 10.0);
    let rate = Axis::linear(all.copied().fold(0.0, f64::max), (bottom, top), 6.0);

    let mut svg = String::new();
    let canvas = Canvas::new(&mut svg, WIDTH, HEIGHT)?;
    canvas.bold(&report.title, (28.0, 34.0), 24.0)?;
    let what = "Bitrate with all headers (kbit/s)";
    canvas.bold(what, (28.0, 68.0), 16.0)?;
    for &tick in &rate.ticks {
        let y = rate.at(tick);
        canvas.line(&[(left, y), (right, y)], 1, GRID)?;
        canvas.text(&number(tick), (left - 10.0, y), 14.0, Anchor::Right, FAINT)?;
    }
    for &tick in &time.ticks {
        let x = time.at(tick);
        canvas.line(&[(x, bottom), (x, bottom + 5.0)], 1, FAINT)?;
        canvas.text(
            &number(tick),
            (x, bottom + 18.0),
            14.0,
            Anchor::Middle,
            FAINT,
        )?;
    }
    let middle = (left + right) / 2.0;
    canvas.text(
        "time (s)",
        (middle, bottom + 42.0),
        15.0,
        Anchor::Middle,
        INK,
    )?;

    let mut labels = Vec::new();
    for (index, series) in series.iter().enumerate() {
        let points: Vec<(f64, f64)> = (0_u32..)
            .zip(&series.kbit_s)
            .filter(|(_, kbit_s)| kbit_s.is_finite())
            .map(|(second, &kbit_s)| (time.at(f64::from(second)), rate.at(kbit_s)))
            .collect();
        canvas.line(&points, 2, colour(index))?;
        if let Some(&end) = points.last() {
            labels.push((end, index, series.name.as_str()));
        }
    }
    // From the top down, none nearer to the one above than a line of text; a thin line leads from the curve's end to its name.
    labels.sort_by(|(a, ..), (b, ..)| a.1.total_cmp(&b.1));
    let mut free_from = top - LABEL;
    for ((x, y), index, name) in labels {
        let label_y = y.max(free_from + LABEL / 2.0);
        free_from = label_y + LABEL / 2.0;
        let label_x = right + 34.0;
        canvas.line(&[(x + 4.0, y), (label_x - 6.0, label_y)], 1, colour(index))?;
        canvas.text(name, (label_x, label_y), 15.0, Anchor::Left, colour(index))?;
    }
    canvas.finish()?;
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::samples;

    #[test]
    fn every_series_has_a_line_and_a_name() {
        let svg = bitrate_chart(&samples::report()).expect("a chart");
        if let Ok(folder) = std::env::var("NETLAB_CHARTS") {
            std::fs::write(format!("{folder}/bitrate.svg"), &svg).expect("written");
        }
        for name in [
            "paper, reliable",
            "paper, unreliable",
            "compact, reliable",
            "compact, unreliable",
        ] {
            assert_eq!(svg.matches(&format!("\n{name}\n")).count(), 1, "{name}");
        }
        assert!(bitrate_chart(&Report::default()).is_ok(), "of nothing");
    }
}
