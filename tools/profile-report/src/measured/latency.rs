//! Latency from capture to display, part by part, as a table with bars.

use app_pipeline::profile::{LatencyBreakdown, Percentiles, Since};

/// Columns of the bars that show where in the whole a part lies.
const BAR: f64 = 40.0;

/// The parts of a picture's latency, which add up to the whole, and each one's place in it.
pub(super) fn table(latency: &LatencyBreakdown) -> Vec<String> {
    let since = match latency.since {
        Since::Capture => "capture",
        Since::Arrival => "arrival",
    };
    let mut lines = vec![format!(
        "{:<24} {:>8} {:>8} {:>8} {:>8}   where in the mean",
        "latency, ms", "mean", "p50", "p95", "p99"
    )];
    let line = |name: &str, t: &Percentiles| {
        format!(
            "{name:<24} {:>8.2} {:>8.2} {:>8.2} {:>8.2}",
            t.mean_ms, t.p50_ms, t.p95_ms, t.p99_ms
        )
    };
    let mut before = 0.0;
    for part in &latency.parts {
        let after = before + part.times.mean_ms;
        let column = |ms: f64| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "casting saturates, and a column is at most BAR"
            )]
            let column = (ms / latency.whole.mean_ms.max(1e-3) * BAR)
                .clamp(0.0, BAR)
                .round() as usize;
            column
        };
        let (left, right) = (column(before.min(after)), column(before.max(after)));
        let bar = if right > left {
            "█".repeat(right - left)
        } else {
            "▏".to_owned()
        };
        let row = format!(
            "{}   {}{bar}",
            line(part.part.name(), &part.times),
            " ".repeat(left)
        );
        lines.push(row);
        before = after;
    }
    lines.push(format!(
        "{}   means add up, percentiles do not",
        line(&format!("{since} to display"), &latency.whole)
    ));
    if latency.left_out > 0 {
        lines.push(format!(
            "{} pictures are left out: no frame brought what they show",
            latency.left_out
        ));
    }
    lines
}
