//! The report as text, at most 100 columns wide.

use std::fmt;

use super::{CallRow, Report};

const WIDTH: usize = 100;
const COLUMNS: [&str; 11] = [
    "condition",
    "codec",
    "channel",
    "down",
    "up",
    "p50",
    "p95",
    "p99",
    "frames",
    "lost",
    "recover",
];
const UNITS: [&str; 11] = [
    "", "", "", "kbit/s", "kbit/s", "ms", "ms", "ms", "", "%", "s",
];
/// The first so many columns are words and stand left; figures stand right.
const WORDS: usize = 3;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.title.is_empty() {
            for line in wrap(&self.title, WIDTH) {
                writeln!(f, "{line}")?;
            }
            writeln!(f)?;
        }
        let mut rows = vec![COLUMNS.map(str::to_owned), UNITS.map(str::to_owned)];
        let mut previous = None;
        for call in &self.calls {
            // A condition is said once, above its calls.
            let condition = if previous == Some(&call.condition) {
                String::new()
            } else {
                call.condition.clone()
            };
            previous = Some(&call.condition);
            rows.push(cells(call, condition));
        }
        let mut widths = [0; 11];
        for row in &rows {
            for (width, cell) in widths.iter_mut().zip(row) {
                *width = (*width).max(cell.chars().count());
            }
        }
        // Long conditions are wrapped over several lines.
        let others: usize = widths.iter().skip(1).sum::<usize>() + 2 * (COLUMNS.len() - 1);
        let [condition_width, ..] = &mut widths;
        *condition_width = (*condition_width).min(WIDTH.saturating_sub(others).max(9));
        let condition_width = *condition_width;

        for (index, row) in rows.iter().enumerate() {
            let [condition, rest @ ..] = row;
            if index == 2 || (index > 2 && !condition.is_empty()) {
                let total = condition_width + others;
                writeln!(f, "{}", "-".repeat(total.min(WIDTH)))?;
            }
            let mut lines = wrap(condition, condition_width).into_iter();
            let mut text = pad(&lines.next().unwrap_or_default(), condition_width);
            for (column, (cell, &width)) in rest.iter().zip(widths.iter().skip(1)).enumerate() {
                let cell = if column + 1 < WORDS {
                    pad(cell, width)
                } else {
                    format!("{cell:>width$}")
                };
                text.push_str("  ");
                text.push_str(&cell);
            }
            writeln!(f, "{}", text.trim_end())?;
            for more in lines {
                writeln!(f, "{more}")?;
            }
        }
        if !self.notes.is_empty() {
            writeln!(f)?;
        }
        for note in &self.notes {
            for line in wrap(note, WIDTH) {
                writeln!(f, "{line}")?;
            }
        }
        Ok(())
    }
}

fn cells(call: &CallRow, condition: String) -> [String; 11] {
    let latency = |of: fn(&super::LatencyMs) -> f64| {
        call.latency_ms
            .as_ref()
            .map_or_else(|| "-".to_owned(), |l| format!("{:.1}", of(l)))
    };
    [
        condition,
        call.codec.clone(),
        call.channel.clone(),
        format!("{:.1}", call.down_kbit_s),
        format!("{:.1}", call.up_kbit_s),
        latency(|l| l.p50),
        latency(|l| l.p95),
        latency(|l| l.p99),
        call.frames.sent.to_string(),
        format!("{:.2}", call.frames.lost_percent()),
        call.recover_s
            .map_or_else(|| "-".to_owned(), |s| format!("{s:.2}")),
    ]
}

fn pad(text: &str, width: usize) -> String {
    format!("{text:<width$}")
}

/// Breaks between words; a word that is too long stays whole.
fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        if let Some(line) = lines.last_mut() {
            let taken = line.chars().count();
            if taken == 0 {
                line.push_str(word);
            } else if taken + 1 + word.chars().count() <= width {
                line.push(' ');
                line.push_str(word);
            } else {
                lines.push(word.to_owned());
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use crate::report::samples;

    #[test]
    fn the_table_is_aligned_and_at_most_a_hundred_columns() {
        let mut report = samples::report();
        let text = report.to_string();
        println!("{text}");
        assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
        let ends: Vec<usize> = text
            .lines()
            .filter(|l| l.contains("reliable"))
            .map(|l| l.chars().count())
            .collect();
        assert!(
            ends.len() == 16 && ends.windows(2).all(|w| w[0] == w[1]),
            "the last figures end in one column: {ends:?}"
        );
        // A condition that says everything takes more lines, not more columns.
        report.calls[0].condition = "20 ms +-5 ms, 5 % lost in bursts, 0.5 % twice, trace traces/lte-walk.csv, out for 3 s at 10 s".into();
        let text = report.to_string();
        assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
        assert!(
            text.contains("out for"),
            "and nothing of it is lost: {text}"
        );
    }

    #[test]
    fn a_call_without_frames_has_no_latency() {
        let mut report = samples::report();
        report.calls.truncate(1);
        report.calls[0].latency_ms = None;
        report.calls[0].frames.shown = 0;
        let text = report.to_string();
        let row = text.lines().find(|l| l.contains("reliable"));
        let words: Vec<&str> = row.expect("its row").split_whitespace().collect();
        assert_eq!(words[5..], ["-", "-", "-", "1800", "100.00", "-"], "{text}");
    }
}
